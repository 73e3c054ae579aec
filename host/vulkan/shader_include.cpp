// SPDX-License-Identifier: Apache-2.0
// Names in #include -> texts: generated ones of the join, files of the technique's folder, files of the shared folders.
#include "vulkan/shader_source.hpp"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

namespace heddle::vulkan::shader {

namespace fs = std::filesystem;

const SourceFile* SourceSet::generated(const std::string& name, const std::string& text) {
  return &files_.try_emplace(name, SourceFile{name, text}).first->second;
}

const SourceFile* SourceSet::file(const fs::path& path) {
  const std::string name = path.lexically_normal().string();
  if (const auto known = files_.find(name); known != files_.end()) return &known->second;
  std::optional<std::string> text = read_file(path);
  if (!text) return nullptr;
  return &files_.emplace(name, SourceFile{name, std::move(*text)}).first->second;
}

const SourceFile* SourceSet::find(std::string_view requested, std::string_view requester, std::string& problem) {
  const ShaderRequest& request = *join_.request;
  const std::string name(requested);
  if (name == "pass.glsl") return generated(name, join_.pass_glsl);
  if (name.starts_with("role/") && name.ends_with(".glsl")) {
    const std::string role = name.substr(5, name.size() - 10);
    if (const auto found = join_.role_glsl.find(role); found != join_.role_glsl.end()) {
      return generated(name, found->second);
    }
    problem = fmt::format("role '{}' is included and is not among its `calls`", role);
    return nullptr;
  }
  if (name.starts_with("provider/")) {
    std::size_t index = 0;
    const char* const end = name.data() + name.size();
    const auto parsed = std::from_chars(name.data() + 9, end, index);
    if (parsed.ec == std::errc() && parsed.ptr != end && index < join_.providers.size()) {
      const Provider& provider = join_.providers[index];
      const std::string own(parsed.ptr + 1, end);
      if (const auto text = provider.texts.find(own); text != provider.texts.end()) {
        return &files_.try_emplace(name, SourceFile{name_of(provider, own), text->second}).first->second;
      }
    }
  }
  if (const auto made = request.texts.find(name); made != request.texts.end()) return generated(name, made->second);
  if (requester == kMainName && name.starts_with("caller/")) return file(request.folder / name.substr(7));

  const fs::path folder = request.folder.lexically_normal();
  const fs::path beside = fs::path(requester).parent_path();
  std::vector<fs::path> places;
  if (!beside.empty() && fs::path(requester).is_absolute() == folder.is_absolute()) places.push_back(beside);
  const std::string below = beside.lexically_relative(folder).generic_string();
  const bool is_own = request.texts.contains(requester) || (!below.empty() && !below.starts_with(".."));
  if (!request.folder.empty() && is_own) places.push_back(folder);
  places.insert(places.end(), request.shared_folders.begin(), request.shared_folders.end());
  for (const fs::path& place : places) {
    if (const SourceFile* found = file(place / name)) return found;
  }
  problem = fmt::format("the included file '{}' is neither in the technique's folder nor in plugins/shared", name);
  return nullptr;
}

std::vector<const SourceFile*> SourceSet::closure() {
  std::vector<const SourceFile*> out{generated(std::string(kMainName), join_.main)};
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Scan facts = scan(out[i]->text);
    for (const Include& include : facts.includes) {
      std::string ignored;  // a missing file may stand in a branch that is not compiled
      const SourceFile* found = find(include.name, out[i]->name, ignored);
      if (found != nullptr && std::find(out.begin(), out.end(), found) == out.end()) out.push_back(found);
    }
  }
  return out;
}

}  // namespace heddle::vulkan::shader
