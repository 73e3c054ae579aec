// SPDX-License-Identifier: Apache-2.0
// host/vulkan/shader_cache.cpp: what was compiled once is not compiled again, and nothing stale or damaged is used.
#include "unit/shader/fixture.hpp"
#include "vulkan/shader_source.hpp"

namespace heddle::vulkan {
namespace {

namespace fs = std::filesystem;

class ShaderCache : public ShaderTest {
 protected:
  ShaderCache()
      : role_(light_role(Join::kSum)),
        technique_(provider_technique("light/plain", "plain.glsl",
                                      "#include \"twice.glsl\"\n"
                                      "float light(uint key, vec3 position) { return twice(position.x); }\n")),
        request_(calling_request()) {
    write("shared/twice.glsl", "float twice(float x) { return 2.0 * x; }\n");
    request_.roles = {{&role_, Join::kSum, {provider("sun", technique_)}}};
  }
  CompiledShader run() { return compile(request_, folder_ / "cache"); }
  std::vector<fs::path> entries() {
    std::vector<fs::path> out;
    for (const auto& entry : fs::directory_iterator(folder_ / "cache")) out.push_back(entry.path());
    return out;
  }

  Role role_;
  const Technique& technique_;
  ShaderRequest request_;
};

TEST_F(ShaderCache, HitReturnsTheSameShaderAndDoesNotCallTheCompiler) {
  const CompiledShader first = run();
  const std::uint64_t calls = compiler_calls();
  const CompiledShader second = run();
  EXPECT_EQ(compiler_calls(), calls);
  EXPECT_FALSE(first.is_from_cache);
  EXPECT_TRUE(second.is_from_cache);
  EXPECT_EQ(second.spirv, first.spirv);
  EXPECT_EQ(second.bindings, first.bindings);
  EXPECT_EQ(second.local_size, first.local_size);
  EXPECT_EQ(second.loops, first.loops);
  ASSERT_EQ(entries().size(), 1U) << "no temporary file stays";
  EXPECT_EQ(entries()[0].extension(), ".shader");
}

TEST_F(ShaderCache, ChangedTextIsCompiledAgainWhereverItStands) {
  run();
  const auto compiles = [&] {
    const std::uint64_t calls = compiler_calls();
    run();
    return compiler_calls() - calls;
  };
  EXPECT_EQ(compiles(), 0U);
  write("shared/twice.glsl", "float twice(float x) { return x + x; }\n");
  EXPECT_EQ(compiles(), 1U) << "a shared file";
  write("light/plain/plain.glsl",
        "#include \"twice.glsl\"\nfloat light(uint key, vec3 position) { return twice(position.y); }\n");
  EXPECT_EQ(compiles(), 1U) << "a provider's file";
  role_.join = Join::kProduct;
  request_.roles[0].providers.clear();
  role_.functions[0].neutral = "return 0.25;";
  EXPECT_EQ(compiles(), 1U) << "a neutral body";
  request_.ports.push_back(image("more", HEDDLE_ACCESS_SAMPLED, VK_FORMAT_R32_SFLOAT));
  EXPECT_EQ(compiles(), 1U) << "a port";
  request_.ports.back().format = VK_FORMAT_R32_UINT;
  EXPECT_EQ(compiles(), 1U) << "a format";
  EXPECT_EQ(compiles(), 0U);
}

TEST_F(ShaderCache, ChangedTextOfAPassIsCompiledAgain) {
  write("caller/generated/gain.glsl", "const float gain = 1.0;\n");
  write("light/plain/generated/tint.glsl", "const float tint = 1.0;\n");
  write("caller/shade.glsl",
        "#include \"pass.glsl\"\n#include \"role/light.glsl\"\n#include \"generated/gain.glsl\"\n"
        "layout(local_size_x = 8) in;\nvoid main() { result[0] = gain * light(0u, vec3(1.0)); }\n");
  write("light/plain/plain.glsl",
        "#include \"generated/tint.glsl\"\nfloat light(uint key, vec3 position) { return tint * position.x; }\n");
  const auto compiles = [&] {
    const std::uint64_t calls = compiler_calls();
    run();
    return compiler_calls() - calls;
  };
  EXPECT_EQ(compiles(), 1U) << "the files that stand in";
  request_.texts["generated/gain.glsl"] = "const float gain = 2.0;\n";
  EXPECT_EQ(compiles(), 1U) << "the caller's text";
  EXPECT_EQ(compiles(), 0U);
  request_.texts["generated/gain.glsl"] = "const float gain = 3.0;\n";
  EXPECT_EQ(compiles(), 1U) << "another text of the caller";
  request_.roles[0].providers[0].texts["generated/tint.glsl"] = "const float tint = 2.0;\n";
  EXPECT_EQ(compiles(), 1U) << "a provider's text";
  request_.texts.clear();
  request_.roles[0].providers[0].texts.clear();
  EXPECT_EQ(compiles(), 0U) << "the files again";
}

TEST_F(ShaderCache, DamagedEntryIsNoEntry) {
  const CompiledShader first = run();
  const fs::path file = entries().at(0);
  const std::string whole = shader::read_file(file).value();
  for (const std::size_t at : {std::size_t{0}, std::size_t{40}, whole.size() / 2, whole.size() - 1}) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x20);
    std::ofstream(file, std::ios::binary) << damaged;
    const std::uint64_t calls = compiler_calls();
    EXPECT_EQ(run().spirv, first.spirv);
    EXPECT_EQ(compiler_calls(), calls + 1) << "byte " << at;
    EXPECT_EQ(shader::read_file(file).value(), whole) << "the entry is written anew";
  }
  std::ofstream(file, std::ios::binary) << whole.substr(0, whole.size() - 100);
  EXPECT_EQ(run().spirv, first.spirv);
}

TEST_F(ShaderCache, FolderThatCannotBeWrittenIsAWarning) {
  write("cache", "a file where the folder should be");
  const CompiledShader shader = run();
  ASSERT_EQ(shader.warnings.size(), 1U);
  EXPECT_THAT(shader.warnings[0], testing::StartsWith("the shader cache " + place("cache") + " cannot be made: "));
}

TEST_F(ShaderCache, MeshProgramIsCachedToo) {
  const SurfaceProgram first = mesh_program(folder_ / "cache", shared_);
  const std::uint64_t calls = compiler_calls();
  const SurfaceProgram second = mesh_program(folder_ / "cache", shared_);
  EXPECT_EQ(compiler_calls(), calls);
  EXPECT_EQ(second.vertex, first.vertex);
  EXPECT_EQ(second.masked_fragment, first.masked_fragment);
}

// Source: Fowler, Noll, Vo, "The FNV Non-Cryptographic Hash Algorithm", test vectors of FNV-1a 128: the hash of "" is
// the offset basis; add() hashes a length of 8 bytes first, so vectors are made from the definition in Python's
// integers.
TEST(ContentHash, IsFnv1aWith128Bits) {
  ContentHash empty;
  EXPECT_EQ(empty.hexadecimal(), "6c62272e07bb014262b821756295c58d");
  ContentHash hash;
  hash.add("heddle");
  EXPECT_EQ(hash.hexadecimal(), "94cd0acdab0024ea82e77382d6bf68af");
}

}  // namespace
}  // namespace heddle::vulkan
