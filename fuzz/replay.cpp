// Stands in for libFuzzer in ./run test: every file of a target's corpus, then a fixed number of seeded mutations of
// them. Usage: fuzz_replay NAME [MUTATIONS]
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <vector>

#include "berth/base/random.hpp"
#include "fuzz/replay.hpp"

namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> corpus(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  if (std::filesystem::is_directory(folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  std::vector<Bytes> files{Bytes{}};
  for (const auto& path : paths) {
    std::ifstream in(path, std::ios::binary);
    files.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return files;
}

void mutate(Bytes& bytes, berth::Random& random) {
  const auto edits = 1 + random.below(4);
  for (std::uint64_t i = 0; i < edits; ++i) {
    const auto at = random.below(bytes.size() + 1);
    switch (random.below(4)) {
      case 0:
        if (at < bytes.size()) bytes[at] = static_cast<std::uint8_t>(random.next());
        break;
      case 1:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::uint8_t>(random.next()));
        break;
      case 2:
        if (at < bytes.size()) bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      default:
        if (at < bytes.size()) bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ (1U << random.below(8)));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view name = argc > 1 ? argv[1] : "";
  const auto target = std::ranges::find(targets(), name, &Target::name);
  if (target == targets().end()) {
    std::fprintf(stderr, "usage: fuzz_replay NAME [MUTATIONS]; one of");
    for (const auto& each : targets()) std::fprintf(stderr, " %s", each.name);
    std::fprintf(stderr, "\n");
    return 2;
  }
  const auto runs = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 2000ULL;
  const auto files = corpus(std::filesystem::path(corpus_folder) / name);
  for (const auto& file : files) target->input(file.data(), file.size());
  berth::Random random(1);
  for (std::uint64_t i = 0; i < runs; ++i) {
    Bytes bytes = files[random.below(files.size())];
    const auto rounds = 1 + random.below(8);
    for (std::uint64_t k = 0; k < rounds; ++k) mutate(bytes, random);
    target->input(bytes.data(), bytes.size());
  }
  std::printf("%s: %zu corpus files, %llu mutations\n", target->name, files.size() - 1, runs);
  return 0;
}
