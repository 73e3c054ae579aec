// SPDX-License-Identifier: Apache-2.0
// replay FOLDER [MUTATIONS]: runs a fuzz target over every file of a corpus, and over copies of each with a few bytes
// changed, cut out or repeated, always the same ones.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

void run(const Bytes& bytes) {
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
}

Bytes mutated(Bytes bytes, std::mt19937& generator) {
  // Plain modulo, not a distribution: those differ between libraries, and a failure must repeat anywhere.
  const auto below = [&](std::size_t bound) {
    return static_cast<std::size_t>(generator()) % std::max<std::size_t>(bound, 1);
  };
  const std::size_t changes = 1 + below(4);
  for (std::size_t i = 0; i < changes && !bytes.empty(); ++i) {
    const std::size_t at = below(bytes.size());
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const std::size_t length = std::min(1 + below(16), bytes.size() - at);
    switch (below(6)) {
      case 0:
        *place = static_cast<std::uint8_t>(generator());
        break;
      case 1:
        *place = static_cast<std::uint8_t>(*place ^ (1U << below(8)));
        break;
      case 2:
        bytes.erase(place, place + static_cast<std::ptrdiff_t>(length));
        break;
      case 3: {
        const Bytes repeated(place, place + static_cast<std::ptrdiff_t>(length));
        bytes.insert(place, repeated.begin(), repeated.end());
        break;
      }
      case 4: {  // what breaks ranges: the ends of integers
        static constexpr std::uint8_t kEnds[] = {0x00, 0x7f, 0x80, 0xff};
        std::fill_n(place, std::min<std::size_t>(length, 4), kEnds[below(4)]);
        break;
      }
      default: {  // digits, in the JSON
        static constexpr char kDigits[] = "0123456789-.e";
        *place = static_cast<std::uint8_t>(kDigits[below(sizeof kDigits - 1)]);
      }
    }
  }
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s FOLDER [MUTATIONS]\n", argv[0]);
    return 2;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  const int mutations = argc > 2 ? std::atoi(argv[2]) : 0;
  std::mt19937 generator(1);
  for (const std::filesystem::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const Bytes bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    run(bytes);
    for (int i = 0; i < mutations; ++i) run(mutated(bytes, generator));
  }
  std::printf("%zu files, %d mutations of each\n", files.size(), mutations);
  return files.empty() ? 1 : 0;
}
