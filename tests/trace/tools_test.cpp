// Other people's tools on what is written here, and what they write read here: tshark (pcapng, candump), log2asc and
// asc2log of can-utils. Where a tool is missing the test says so.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <chrono>
#include <string>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "formats.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;
using test::read;
using test::write;

bool there(const std::string& tool) { return std::system(("command -v " + tool + " >/dev/null 2>&1").c_str()) == 0; }

// Skips, or fails where the environment wants the peers to be there.
#define NEEDS(tool)                                                                              \
  if (!there(tool)) {                                                                            \
    const char* const wanted = std::getenv("BERTH_REQUIRE");                                     \
    if (wanted != nullptr && std::string(wanted).find("peers") != std::string::npos)             \
      FAIL() << tool << " is not installed";                                                     \
    GTEST_SKIP() << tool << " is not installed: what it makes of these files was not looked at"; \
  }

class Folder {
 public:
  Folder() : path_(std::filesystem::temp_directory_path() / ("berth-tools-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string file(const std::string& name, const std::string& bytes) const {
    const auto path = (path_ / name).string();
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

 private:
  std::filesystem::path path_;
};

std::string output_of(const std::string& command) {
  std::string all;
  std::FILE* const pipe = ::popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return all;
  char buffer[4096];
  while (const auto got = std::fread(buffer, 1, sizeof buffer, pipe)) all.append(buffer, got);
  ::pclose(pipe);
  return all;
}

Trace sample() {
  Trace trace;
  trace.buses = {"can0", "can1"};
  can::Frame fd = can::Frame::base(0x123, {0xAA, 0xBB});
  fd.fd = fd.brs = true;
  trace.entries.push_back(
      {1436509052s + 249713us, 0, can::Frame::base(0x7E5, {0x51, 0, 0, 0, 0, 0x80, 0, 0}), Direction::received});
  trace.entries.push_back({1436509052s + 250001us, 1, can::Frame::ext(0x1F90'0135, {}), Direction::received});
  trace.entries.push_back({1436509052s + 250400us, 0, can::Frame::request(0x701, 1), Direction::sent});
  trace.entries.push_back({1436509052s + 250900us, 0, fd, Direction::received});
  return trace;
}

constexpr const char* fields =
    " -T fields -e frame.time_epoch -e can.id -e can.flags.xtd -e can.flags.rtr -e can.len -e frame.interface_name";

TEST(OtherTools, TsharkReadsOurPcapng) {
  NEEDS("tshark");
  const Folder folder;
  const auto path = folder.file("t.pcapng", write(Format::pcapng, sample()).bytes);
  const auto text = output_of("tshark -r " + path + fields);
  EXPECT_EQ(text,
            "1436509052.249713000\t2021\t0\t0\t8\tcan0\n"
            "1436509052.250001000\t529531189\t1\t0\t0\tcan1\n"
            "1436509052.250400000\t1793\t0\t1\t1\tcan0\n"
            "1436509052.250900000\t291\t0\t\t2\tcan0\n");
  const auto malformed = output_of("tshark -r " + path + " -Y _ws.malformed");
  EXPECT_EQ(malformed, "");
}

TEST(OtherTools, TsharkReadsOurCandump) {
  NEEDS("tshark");
  const Folder folder;
  const auto path = folder.file("t.log", write(Format::candump, sample(), {.directions = false}).bytes);
  const auto text = output_of("tshark -r " + path + " -T fields -e frame.time_epoch -e can.id -e can.len");
  EXPECT_EQ(text,
            "1436509052.249713000\t2021\t8\n1436509052.250001000\t529531189\t0\n"
            "1436509052.250400000\t1793\t1\n1436509052.250900000\t291\t2\n");
}

// What tshark writes again as pcapng is what was given.
TEST(OtherTools, WhatTsharkWritesIsReadHere) {
  NEEDS("tshark");
  const Folder folder;
  const Trace trace = sample();
  const auto path = folder.file("t.pcapng", write(Format::pcapng, trace).bytes);
  const auto again = folder.file("again.pcapng", "");
  ASSERT_EQ(std::system(("tshark -r " + path + " -w " + again + " >/dev/null 2>&1").c_str()), 0);
  std::ifstream in(again, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const auto kept = read(Format::pcapng, bytes);
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  EXPECT_EQ(kept.trace, trace);
}

// The same as classic pcap, which has one bus.
TEST(OtherTools, WhatTsharkWritesAsPcapIsReadHere) {
  NEEDS("tshark");
  const Folder folder;
  Trace trace = sample();
  std::erase_if(trace.entries, [](const Entry& entry) { return entry.bus != 0; });
  for (auto& entry : trace.entries) entry.direction = Direction::unknown;
  trace.buses.resize(1);
  const auto path = folder.file("t.pcapng", write(Format::pcapng, trace).bytes);
  for (const char* const kind : {"pcap", "nsecpcap"}) {
    const auto again = folder.file("again.pcap", "");
    ASSERT_EQ(std::system(fmt::format("tshark -F {} -r {} -w {} >/dev/null 2>&1", kind, path, again).c_str()), 0);
    std::ifstream in(again, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    EXPECT_EQ(recognise(bytes), Format::pcap) << kind;
    const auto kept = read(Format::pcap, bytes);
    EXPECT_EQ(kept.errors(), 0U) << kept.text();
    EXPECT_EQ(kept.trace, trace) << kind;
  }
}

TEST(OtherTools, WhatLog2ascWritesIsReadHere) {
  NEEDS("log2asc");
  const Folder folder;
  const Trace trace = sample();
  const auto path = folder.file("t.log", write(Format::candump, trace).bytes);
  const auto text = output_of("TZ=UTC log2asc -I " + path + " can0 can1");
  const auto kept = read(Format::asc, text);
  EXPECT_EQ(kept.errors(), 0U) << kept.text() << text;
  ASSERT_EQ(kept.trace.entries.size(), trace.entries.size()) << text;
  for (std::size_t i = 0; i < trace.entries.size(); ++i) {
    EXPECT_EQ(kept.trace.entries[i].frame, trace.entries[i].frame) << i;
    EXPECT_EQ(kept.trace.entries[i].direction, trace.entries[i].direction) << i;
    EXPECT_EQ(kept.trace.entries[i].bus, trace.entries[i].bus) << i;
    // It cuts the start to seconds or milliseconds; what is between the frames is exact.
    EXPECT_EQ(kept.trace.entries[i].at - kept.trace.entries[0].at, trace.entries[i].at - trace.entries[0].at) << i;
  }
}

TEST(OtherTools, Asc2logReadsOurAsc) {
  NEEDS("asc2log");
  const Folder folder;
  const Trace trace = sample();
  const auto path = folder.file("t.asc", write(Format::asc, trace).bytes);
  const auto kept = read(Format::candump, output_of("TZ=UTC asc2log -I " + path));
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  ASSERT_EQ(kept.trace.entries.size(), trace.entries.size());
  for (std::size_t i = 0; i < trace.entries.size(); ++i) {
    EXPECT_EQ(kept.trace.entries[i].frame, trace.entries[i].frame) << i;
    EXPECT_EQ(kept.trace.entries[i].at - kept.trace.entries[0].at, trace.entries[i].at - trace.entries[0].at) << i;
  }
}

}  // namespace
}  // namespace berth::trace
