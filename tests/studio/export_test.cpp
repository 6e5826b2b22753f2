// Frames of the ring as files: what is in them is what Berth's own readers read from them, and nothing else.
#include "berth/studio/export.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/can/bus_error.hpp"
#include "server_fixture.hpp"

namespace berth::studio {
namespace {

struct Read final : trace::Sink {
  void entry(const trace::Entry& entry) override { entries.push_back(entry); }
  void finding(Finding finding) override { findings.push_back(to_string(finding)); }
  std::vector<trace::Entry> entries;
  std::vector<std::string> findings;
  std::vector<std::string> buses;
};

Read read_back(trace::Format format, const std::string& text) {
  Read read;
  const auto reader = trace::make_reader(format, "export");
  reader->feed(text, read);
  reader->finish(read);
  read.buses = reader->buses();
  return read;
}

class StudioExport : public ::testing::Test {
 protected:
  void fill(unsigned count) {
    for (unsigned i = 0; i < count; ++i, ++put_)
      ring_.put(static_cast<std::uint8_t>(put_ % 2),
                can::Frame::base(0x700 + put_ % 100, {static_cast<std::uint8_t>(put_ % 3 == 0 ? 0x7F : 0x05)}),
                rt::Time(std::chrono::milliseconds(put_)), put_ % 4 == 0);
  }
  std::string text(const TraceQuery& query, std::size_t at_once = 7) {
    std::string out;
    Export made(ring_, buses_, query);
    while (!made.step(at_once, out)) {
    }
    return out;
  }
  FrameRing ring_{1024};
  std::vector<std::string> buses_{"field", "other bus"};
  unsigned put_ = 0;
};

}  // namespace

TEST_F(StudioExport, EveryFormatHasEveryFrameOfTheRange) {
  fill(100);
  for (const auto format : trace::all_formats) {
    SCOPED_TRACE(trace::name(format));
    const auto read = read_back(format, text({.format = format, .from = 10, .to = 59}));
    EXPECT_TRUE(read.findings.empty()) << read.findings.front();
    ASSERT_EQ(read.entries.size(), 50U);
    for (unsigned i = 0; i < 50; ++i) {
      const unsigned n = i + 10;
      EXPECT_EQ(read.entries[i].frame,
                can::Frame::base(0x700 + n, {static_cast<std::uint8_t>(n % 3 == 0 ? 0x7F : 0x05)}));
      EXPECT_EQ(read.entries[i].at - read.entries[0].at, std::chrono::milliseconds(i));
      EXPECT_EQ(read.entries[i].direction, n % 4 == 0 ? trace::Direction::sent : trace::Direction::received);
      EXPECT_EQ(read.buses[read.entries[i].bus].substr(0, 5), n % 2 == 0 ? "field" : "other");
    }
  }
}

TEST_F(StudioExport, AFilterLetsThroughWhatTheListShows) {
  fill(300);
  const auto read = read_back(trace::Format::candump, text({.filter = "7F field"}));
  ASSERT_EQ(read.entries.size(), 50U);
  for (const auto& entry : read.entries) EXPECT_EQ(entry.frame.data[0], 0x7F);
  EXPECT_EQ(read_back(trace::Format::candump, text({.from = 100, .to = 102, .filter = "#7F"})).entries.size(), 1U);
  EXPECT_EQ(text({.filter = "nothing like it"}), "");
}

// What the ring does not have any more, and what it never had whole.
TEST_F(StudioExport, OnlyWholeFramesThatAreThere) {
  fill(3000);
  EXPECT_EQ(read_back(trace::Format::candump, text({})).entries.size(), 1024U);
  EXPECT_EQ(text({.from = 5000}), "");
  EXPECT_EQ(text({.from = 2000, .to = 1000}), "");
  Export slow(ring_, buses_, {});
  std::string out;
  static_cast<void>(slow.step(1, out));
  fill(2000);
  while (!slow.step(100, out)) {
  }
  EXPECT_EQ(read_back(trace::Format::candump, out).entries.size(), 1U) << "the others were overwritten meanwhile";
}

TEST_F(StudioExport, FdFramesAreWholeAndErrorsAreErrors) {
  can::Frame fd = can::Frame::base(0x123, {1, 2, 3, 4, 5, 6, 7, 8});
  fd.fd = fd.brs = true;
  fd.size = 64;
  for (unsigned i = 8; i < 64; ++i) fd.data[i] = static_cast<std::uint8_t>(0xFF - i);
  const auto report = can::error_report(can::ErrorKind::form, can::ErrorPlace::end_of_frame, false, false, 3, 9);
  ring_.put(0, fd, rt::Time(1ms), false);
  ring_.put_error(1, report, rt::Time(2ms), "x");
  for (const auto format : {trace::Format::candump, trace::Format::pcapng}) {
    SCOPED_TRACE(trace::name(format));
    const auto read = read_back(format, text({.format = format}));
    ASSERT_EQ(read.entries.size(), 2U);
    EXPECT_EQ(read.entries[0].frame, fd);
    EXPECT_FALSE(read.entries[0].error);
    EXPECT_TRUE(read.entries[1].error);
    EXPECT_EQ(read.entries[1].frame.id, report.id);
    EXPECT_EQ(read.entries[1].frame.data[7], 9);
  }
  EXPECT_EQ(read_back(trace::Format::candump, text({.filter = "error form"})).entries.size(), 1U);
  // 64 places for 1024 frames: only the newest of these have their bytes.
  for (unsigned i = 0; i < 100; ++i) ring_.put(0, fd, rt::Time(3ms), false);
  EXPECT_EQ(read_back(trace::Format::candump, text({})).entries.size(), 1U + 64U);
}

TEST(StudioTraceQuery, IsReadOrToldWhatIsWrong) {
  const auto wanted = parse_trace_query("format=trc1.1&from=3&to=9&filter=sdo%20605%23+x");
  ASSERT_TRUE(wanted) << wanted.error();
  EXPECT_EQ(wanted->format, trace::Format::trc);
  EXPECT_TRUE(wanted->trc_1_1);
  EXPECT_EQ(wanted->from, 3U);
  EXPECT_EQ(wanted->to, 9U);
  EXPECT_EQ(wanted->filter, "sdo 605# x");
  EXPECT_TRUE(parse_trace_query(""));
  for (const char* bad : {"format=pcap", "format=", "format", "from=x", "from=-1", "to=99999999999999999999", "who=me",
                          "filter=%", "filter=%2", "filter=%zz", "=1"})
    EXPECT_FALSE(parse_trace_query(bad)) << bad;
  EXPECT_FALSE(parse_trace_query("filter=" + std::string(201, 'x')));
}

TEST_F(StudioServer, TheWholeRingAsAFileInPieces) {
  frames(20'000);
  const auto ask = [this](Connection& client, const std::string& query) {
    client.say(head("GET /api/v1/trace" + query, bearer()));
    EXPECT_TRUE(client.until([&] { return client.in.find("\r\n0\r\n\r\n") != std::string::npos || client.ended; }));
    std::string body, rest = std::exchange(client.in, {});
    EXPECT_EQ(rest.substr(0, 12), "HTTP/1.1 200");
    rest.erase(0, rest.find("\r\n\r\n") + 4);
    for (auto size = std::stoul(rest, nullptr, 16); size > 0; size = std::stoul(rest, nullptr, 16)) {
      body += rest.substr(rest.find("\r\n") + 2, size);
      rest.erase(0, rest.find("\r\n") + 2 + size + 2);
    }
    return body;
  };
  auto client = connect();
  EXPECT_EQ(read_back(trace::Format::candump, ask(*client, "")).entries.size(), 20'000U);
  EXPECT_EQ(read_back(trace::Format::pcapng, ask(*client, "?format=pcapng&from=5&to=6")).entries.size(), 2U);
  EXPECT_EQ(ask(*client, "?filter=nothing%20like%20it"), "");
  EXPECT_EQ(status_of(head("GET /api/v1/trace?format=blf", bearer())), "HTTP/1.1 400");
  EXPECT_EQ(status_of(head("GET /api/v1/trace")), "HTTP/1.1 401");
  EXPECT_EQ(status_of(head("HEAD /api/v1/trace", bearer())), "HTTP/1.1 405");
  EXPECT_EQ(status_of(head("GET /api/v1/traces", bearer())), "HTTP/1.1 404");
}

}  // namespace berth::studio
