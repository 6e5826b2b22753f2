// Bytes of a slot table changed at any places: refused in words, or its content is one that Berth can have written.
//
// Input: groups of three bytes: a place (two bytes, modulo the length) and what stands there.
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include "berth/store/database.hpp"
#include "fuzz/require.hpp"

namespace store_target {

using namespace berth;

namespace {

// A store with a slot, a seat and a history.
std::string honest() {
  std::string folder = "/tmp/berth-fuzz-XXXXXX";
  fuzz::require(::mkdtemp(folder.data()) != nullptr);
  const std::string path = folder + "/s.db";
  {
    auto store = store::Database::open(path, {.sync = false});
    fuzz::require(store.has_value());
    const auto slot = (*store)->declare({"m", "b", "left"});
    fuzz::require(slot && (*store)->ask(*slot, {{1, 2, 3, 4}, NodeId(5)}, "r"));
  }
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  for (const char* const end : {"", ".lock", "-wal", "-shm"}) std::remove((path + end).c_str());
  ::rmdir(folder.c_str());
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string whole = honest();
  std::string bytes = whole;
  for (std::size_t at = 0; at + 3 <= size; at += 3) {
    // Every page has the interesting bytes at its beginning and its end.
    const std::size_t place = (data[at] * std::size_t{509} + data[at + 1]) % bytes.size();
    bytes[place] = static_cast<char>(data[at + 2]);
  }
  const auto seen = store::look(bytes, "x");
  if (size < 3) fuzz::require(seen.has_value());
  if (!seen) fuzz::require(seen.error().message.starts_with("x: "));
  return 0;
}

}  // namespace store_target
