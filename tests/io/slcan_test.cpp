#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <rapidcheck/gtest.h>
#include <termios.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <atomic>
#include <mutex>
#include <thread>

#include "berth/base/random.hpp"
#include "berth/can/length.hpp"
#include "berth/io/slcan_codec.hpp"
#include "berth/io/slcan_port.hpp"

namespace berth::io::slcan_tests {
namespace {

using namespace std::chrono_literals;
using Kind = SlcanLine::Kind;

// ---- the codec ----

// The LAWICEL manual's examples.
TEST(Slcan, LinesOfTheManual) {
  auto l = parse_slcan("t10021133");
  EXPECT_EQ(l.kind, Kind::frame);
  EXPECT_EQ(l.frame, can::Frame::base(0x100, {0x11, 0x33}));
  EXPECT_FALSE(l.time);
  l = parse_slcan("T0000010021133");
  EXPECT_EQ(l.frame, can::Frame::ext(0x100, {0x11, 0x33}));
  l = parse_slcan("r1002");
  EXPECT_EQ(l.frame, can::Frame::request(0x100, 2));
  l = parse_slcan("R000001002");
  EXPECT_TRUE(l.kind == Kind::frame && l.frame.remote && l.frame.extended && l.frame.size == 2);
  l = parse_slcan("t10021133EA5F");
  EXPECT_EQ(l.kind, Kind::frame);
  EXPECT_EQ(l.time, 59'999U);
  l = parse_slcan("r1002D693A3FF");
  EXPECT_EQ(l.time, 0xD693A3FFU);
  EXPECT_EQ(parse_slcan("").kind, Kind::done);
  EXPECT_EQ(parse_slcan("\a").kind, Kind::refused);
  EXPECT_EQ(parse_slcan("z").kind, Kind::taken);
  EXPECT_EQ(parse_slcan("Z").kind, Kind::taken);
  l = parse_slcan("FA4");
  EXPECT_EQ(l.kind, Kind::flags);
  EXPECT_EQ(l.number, slcan_flag::bus_error | slcan_flag::error_passive | slcan_flag::warning);
  l = parse_slcan("V1013");
  EXPECT_TRUE(l.kind == Kind::version && l.text == "V1013");
  EXPECT_EQ(parse_slcan("NA123").kind, Kind::serial);
}

TEST(Slcan, LinesOfCanable2) {
  auto l = parse_slcan("zt10020011");
  EXPECT_EQ(l.kind, Kind::confirmed);
  EXPECT_EQ(l.frame, can::Frame::base(0x100, {0x00, 0x11}));
  l = parse_slcan("t10020011000A0");  // time and error state
  EXPECT_EQ(l.kind, Kind::frame);
  EXPECT_EQ(l.time, 10U);
  l = parse_slcan("d200900112233445566778899AABB");
  EXPECT_TRUE(l.kind == Kind::frame && l.frame.fd && !l.frame.brs && l.frame.size == 12 && l.frame.data[11] == 0xBB);
  l = parse_slcan("B1FFFFFFF01");
  EXPECT_TRUE(l.kind == Kind::frame && l.frame.fd && l.frame.brs && l.frame.esi && l.frame.extended);
  EXPECT_EQ(parse_slcan("b158aa7 github.com/normaldotcom/canable-fw.git").kind, Kind::text);
}

TEST(Slcan, WhatIsNoLine) {
  for (const auto* text :
       {"t", "t100", "t1009112233445566778899", "t1002113", "t100211334", "t8000", "T200000000", "txyz0", "t1002113G",
        "q", "zt1", "F1", "FXY", "t10021133EA5", "rt1002", "1122t10021133", "\x80\x81", "r1009"})
    EXPECT_EQ(parse_slcan(text).kind, Kind::garbage) << text;
}

TEST(Slcan, BitRates) {
  EXPECT_EQ(slcan_rate(10'000), "S0\r");
  EXPECT_EQ(slcan_rate(125'000), "S4\r");
  EXPECT_EQ(slcan_rate(800'000), "S7\r");
  EXPECT_EQ(slcan_rate(1'000'000), "S8\r");
  // 8 MHz / 5 / (1 + 6 + 1): BTR0 = prescaler - 1, BTR1 = (TSEG2 - 1) * 16 + TSEG1 - 1.
  EXPECT_EQ(slcan_rate(200'000), "s0405\r");
  // Rates that are met, and that no divider has to the last bit: 8 MHz / 6 / 16, / 15 / 16, / 13.
  EXPECT_EQ(slcan_rate(83'333), "s051C\r");
  EXPECT_EQ(slcan_rate(33'333), "s0E1C\r");
  EXPECT_EQ(slcan_rate(615'384), "s0019\r");
  for (const auto rate : {0U, 900'000U, 4'000'000U, 0xFFFF'FFFFU}) EXPECT_EQ(slcan_rate(rate), "") << rate;
}

can::Frame any_frame(Random& r) {
  constexpr std::uint8_t sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  can::Frame f;
  f.extended = r.below(2) == 0;
  f.id = static_cast<std::uint32_t>(r.below((f.extended ? can::extended_mask : can::base_mask) + 1ULL));
  f.fd = r.below(4) == 0;
  f.brs = f.fd && r.below(2) == 0;
  f.remote = !f.fd && r.below(4) == 0;
  f.size = sizes[r.below(f.fd ? 16 : 9)];
  for (auto& b : f.data) b = static_cast<std::uint8_t>(r.below(256));
  return f;
}

// Whatever rubbish is between them, up to a CR: every frame whose line is whole comes.
RC_GTEST_PROP(SlcanProperty, FramesComeBackEqualThroughRubbish, (std::uint64_t seed)) {
  Random r(seed);
  std::string out;
  std::vector<can::Frame> given;
  unsigned rubbish = 0;
  const auto count = 1 + r.below(20);
  for (std::uint64_t i = 0; i < count; ++i) {
    if (r.below(4) == 0) {
      ++rubbish;
      const auto length = 1 + r.below(400);
      for (std::uint64_t k = 0; k < length; ++k) out += static_cast<char>(0x80 + r.below(128));
      out += '\r';
    }
    given.push_back(any_frame(r));
    out += write_slcan(given.back());
  }
  SlcanReader reader;
  std::vector<can::Frame> found;
  unsigned broken = 0;
  for (std::size_t at = 0; at < out.size();) {
    const auto n = 1 + r.below(40);
    reader.add(std::string_view(out).substr(at, n));
    at += n;
    while (const auto line = reader.next()) {
      if (line->broken) {
        RC_ASSERT(static_cast<unsigned char>(out[line->at]) >= 0x80);
        ++broken;
        continue;
      }
      const auto parsed = parse_slcan(line->text);
      RC_ASSERT(parsed.kind == Kind::frame);
      found.push_back(parsed.frame);
    }
    RC_ASSERT(reader.kept() <= SlcanReader::longest + 40);
  }
  RC_ASSERT(broken == rubbish);
  RC_ASSERT(found.size() == given.size());
  for (std::size_t i = 0; i < found.size(); ++i) RC_ASSERT(found[i] == given[i]);
}

// Some adapters end their words with CR LF.
TEST(Slcan, LinesThatEndWithCrLf) {
  SlcanReader reader;
  reader.add("V1013\r\nt10021133\r\nz\r\n");
  for (const char* expected : {"V1013", "t10021133", "z"}) {
    const auto line = reader.next();
    ASSERT_TRUE(line);
    EXPECT_EQ(line->text, expected);
    EXPECT_FALSE(line->broken);
  }
  EXPECT_FALSE(reader.next());
}

TEST(Slcan, BelInTheMiddleOfALine) {
  SlcanReader reader;
  reader.add("t100\a\r\ax\r");
  auto line = reader.next();
  ASSERT_TRUE(line && line->broken && line->text == "t100" && line->at == 0);
  line = reader.next();
  ASSERT_TRUE(line && !line->broken && line->text == "\a");
  line = reader.next();
  ASSERT_TRUE(line && line->text.empty());
  line = reader.next();
  ASSERT_TRUE(line && line->text == "\a");
  line = reader.next();
  ASSERT_TRUE(line && line->text == "x");
  EXPECT_FALSE(reader.next());
}

// ---- the port, before an adapter that a thread plays ----

enum class Style : std::uint8_t { silent, lawicel, plain_cr, events };

class Adapter {
 public:
  Adapter(std::string path, Style style) : path_(std::move(path)), style_(style) { plug(); }
  ~Adapter() { unplug(); }
  Adapter(const Adapter&) = delete;
  Adapter& operator=(const Adapter&) = delete;

  void plug() {
    std::array<char, 128> name{};
    int slave = -1;
    termios line{};
    ::cfmakeraw(&line);
    ASSERT_EQ(::openpty(&master_, &slave, name.data(), &line, nullptr), 0);
    ::fcntl(master_, F_SETFL, O_NONBLOCK);
    ::close(slave);
    ::unlink(path_.c_str());
    ASSERT_EQ(::symlink(name.data(), path_.c_str()), 0);
    over_ = false;
    thread_ = std::thread([this] { work(); });
  }
  void unplug() {
    over_ = true;
    if (thread_.joinable()) thread_.join();
    if (master_ >= 0) ::close(master_);
    master_ = -1;
    ::unlink(path_.c_str());
  }
  void put(std::string_view bytes) const {
    while (!bytes.empty()) {
      const auto n = ::write(master_, bytes.data(), bytes.size());
      if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
      if (n < 0 && errno != EAGAIN) return;
    }
  }
  [[nodiscard]] std::vector<std::string> commands() {
    const std::scoped_lock lock(mutex_);
    return commands_;
  }
  void forget() {
    const std::scoped_lock lock(mutex_);
    commands_.clear();
  }
  [[nodiscard]] bool heard(const std::string& command) {
    const std::scoped_lock lock(mutex_);
    return std::ranges::find(commands_, command) != commands_.end();
  }
  std::atomic<int> refuse{0};           // so many frames
  std::atomic<bool> acknowledge{true};  // is somebody on the bus?
  std::atomic<bool> refuse_rate{false};
  std::atomic<const char*> flags{"F00\r"};

 private:
  void work() {
    std::string in;
    std::array<char, 1024> buffer;
    while (!over_) {
      pollfd wait{master_, POLLIN, 0};
      ::poll(&wait, 1, 5);
      const auto n = ::read(master_, buffer.data(), buffer.size());
      if (n <= 0) {
        std::this_thread::sleep_for(1ms);  // a line without a reader says at once that it hung up, again and again
        continue;
      }
      in.append(buffer.data(), static_cast<std::size_t>(n));
      for (auto end = in.find('\r'); end != std::string::npos; end = in.find('\r')) {
        act(in.substr(0, end));
        in.erase(0, end + 1);
      }
    }
  }
  void act(const std::string& command) {
    {
      const std::scoped_lock lock(mutex_);
      commands_.push_back(command);
    }
    const char c = command.empty() ? '\0' : command[0];
    if (style_ == Style::silent) {
      if (c == 'V') put("b158aa7 github.com/normaldotcom/canable-fw.git\r");
      return;
    }
    switch (c) {
      case 'C': return put(open_.exchange(false) ? "\r" : "\a");
      case 'V': return put("V1013\r");
      case 'S':
      case 's': return put(refuse_rate ? "\a" : "\r");
      case 'O':
      case 'L': open_ = true; return put("\r");
      case 'z': return put(style_ == Style::events ? "\r" : "\a");
      case 'F': return put(flags.load());
      case 't':
      case 'T':
      case 'r':
      case 'R': return frame(command);
      default: return put("\a");
    }
  }
  void frame(const std::string& command) {
    if (refuse > 0) {
      --refuse;
      return put("\a");
    }
    if (style_ == Style::lawicel) return put(command[0] == 't' || command[0] == 'r' ? "z\r" : "Z\r");
    put("\r");
    if (style_ == Style::events && acknowledge) put("z" + command + "\r");
  }

  std::string path_;
  Style style_;
  int master_ = -1;
  std::thread thread_;
  std::atomic<bool> over_{false};
  std::atomic<bool> open_{false};
  std::mutex mutex_;
  std::vector<std::string> commands_;
};

class Ear final : public can::Listener {
 public:
  void received(const can::Frame& f, rt::Time) noexcept override { frames.push_back(f); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { tags.push_back(tag); }
  void changed(const can::Status& s, rt::Time) noexcept override { ups.push_back(s.up); }
  std::vector<can::Frame> frames;
  std::vector<std::uint32_t> tags;
  std::vector<bool> ups;
};

constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

class SlcanPortTest : public ::testing::Test {
 protected:
  std::unique_ptr<SlcanPort> open(const SlcanOptions& options = {.bit_rate = 125'000, .timeout = 30s}) {
    auto port = SlcanPort::open(loop_, path_, options);
    EXPECT_TRUE(port) << port.error();
    if (!port) return nullptr;
    (*port)->listen(&ear_, everything);
    return std::move(*port);
  }
  template <class Done>
  bool run_until(Done done) {
    const auto end = std::chrono::steady_clock::now() + 30s;
    while (!done()) {
      if (std::chrono::steady_clock::now() > end) return false;
      loop_.turn(1ms);
    }
    return true;
  }
  void run_for(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    run_until([&] { return std::chrono::steady_clock::now() > end; });
  }

  std::string path_ = "/tmp/berth-slcan-" + std::to_string(::getpid());
  rt::Executor executor_;
  Loop loop_{executor_};
  Ear ear_;
};

using Texts = std::vector<std::string>;

TEST_F(SlcanPortTest, AnAdapterThatAnswersIsLedStepByStep) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(adapter.commands(), (Texts{"C", "C", "V", "S4", "z0003", "O"}));
  EXPECT_EQ(port->version(), "V1013");
  EXPECT_EQ(port->confirms(), Confirms::answers);
  EXPECT_TRUE(port->status().up);
  EXPECT_FALSE(port->status().knows_sent);
  EXPECT_EQ(port->status().bit_rate, 125'000U);
  adapter.put("t7E484FA0000000000000\rT1F94000000\rr7011\r");
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() == 3; }));
  EXPECT_EQ(ear_.frames[0], can::Frame::base(0x7E4, {0x4F, 0xA0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(ear_.frames[1].key(), 0x1F940000U | can::extended_flag);
  EXPECT_TRUE(ear_.frames[2].remote);
  EXPECT_EQ(port->send(can::Frame::base(0x7E5, {4, 1}), 7), can::Queued::yes);
  EXPECT_EQ(port->send(can::Frame::ext(0x1F940000, {}), 8), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return ear_.tags.size() == 2; }));
  EXPECT_EQ(ear_.tags, (std::vector<std::uint32_t>{7, 8}));
  EXPECT_TRUE(adapter.heard("t7E520401"));
  EXPECT_TRUE(adapter.heard("T1F9400000"));
}

TEST_F(SlcanPortTest, AnAdapterThatSaysNothingIsWrittenToBlindly) {
  Adapter adapter(path_, Style::silent);
  const auto port = open();
  ASSERT_TRUE(port);
  ASSERT_TRUE(run_until([&] { return adapter.heard("O"); }));
  EXPECT_EQ(adapter.commands(), (Texts{"C", "C", "V", "S4", "M0", "O"}));
  EXPECT_EQ(port->confirms(), Confirms::nothing);
  for (std::uint32_t i = 1; i <= 200; ++i) {
    ASSERT_TRUE(run_until([&] { return port->send(can::Frame::base(i, {1}), i) == can::Queued::yes; }));
  }
  ASSERT_TRUE(run_until([&] { return ear_.tags.size() == 200 && adapter.heard("t0C8101"); }));
}

TEST_F(SlcanPortTest, ListeningOnly) {
  {
    Adapter adapter(path_, Style::plain_cr);
    const auto port = open({.bit_rate = 250'000, .listen_only = true, .timeout = 30s});
    ASSERT_TRUE(port);
    EXPECT_EQ(adapter.commands().back(), "L");
    EXPECT_EQ(port->send(can::Frame::base(1, {}), 1), can::Queued::listen_only);
    EXPECT_TRUE(port->status().listen_only);
  }
  Adapter adapter(path_, Style::silent);
  const auto port = open({.bit_rate = 250'000, .listen_only = true, .timeout = 30s});
  ASSERT_TRUE(port);
  ASSERT_TRUE(run_until([&] { return adapter.heard("O"); }));
  EXPECT_TRUE(adapter.heard("M1"));
}

// CANable 2 with transmit events: `sent` is the acknowledgement on the bus.
TEST_F(SlcanPortTest, TransmitEventsAreTheTruth) {
  Adapter adapter(path_, Style::events);
  const auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->confirms(), Confirms::events);
  EXPECT_TRUE(port->status().knows_sent);
  adapter.acknowledge = false;
  EXPECT_EQ(port->send(can::Frame::base(0x123, {1}), 5), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return adapter.heard("t123101"); }));
  run_for(50ms);
  EXPECT_TRUE(ear_.tags.empty());
  EXPECT_EQ(port->status().queued, 1U);
  adapter.put("zt123101\r");
  ASSERT_TRUE(run_until([&] { return !ear_.tags.empty(); }));
  EXPECT_EQ(ear_.tags, std::vector<std::uint32_t>{5});
  EXPECT_TRUE(ear_.frames.empty());
  EXPECT_EQ(port->status().queued, 0U);
}

TEST_F(SlcanPortTest, ARefusedFrameIsGivenAgainAndTheOrderHolds) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  adapter.forget();
  adapter.refuse = 3;
  for (std::uint32_t i = 1; i <= 4; ++i) EXPECT_EQ(port->send(can::Frame::base(i, {}), i), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return ear_.tags.size() == 4; }));
  EXPECT_EQ(ear_.tags, (std::vector<std::uint32_t>{1, 2, 3, 4}));
  auto commands = adapter.commands();
  std::erase(commands, "F");
  EXPECT_EQ(commands, (Texts{"t0010", "t0010", "t0010", "t0010", "t0020", "t0030", "t0040"}));
  EXPECT_EQ(port->status().errors, 3U);
}

TEST_F(SlcanPortTest, TheQueueIsBoundedAndWhatWaitsCanBeTakenBack) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  adapter.refuse = 1'000'000;
  for (std::uint32_t i = 1; i <= SlcanPort::queue_depth; ++i)
    EXPECT_EQ(port->send(can::Frame::base(i, {}), i), can::Queued::yes);
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 1), can::Queued::full);
  EXPECT_EQ(port->status().queued, SlcanPort::queue_depth);
  port->withdraw(3);
  EXPECT_EQ(port->send(can::Frame::base(0x7FF, {}), 100), can::Queued::yes);
  adapter.refuse = 0;
  ASSERT_TRUE(run_until([&] { return ear_.tags.size() == SlcanPort::queue_depth; }));
  EXPECT_EQ(std::ranges::count(ear_.tags, 3U), 0);
  EXPECT_FALSE(adapter.heard("t0030"));
  EXPECT_EQ(ear_.tags.back(), 100U);
  can::Frame fd = can::Frame::base(1, {});
  fd.fd = true;
  EXPECT_EQ(port->send(fd, 1), can::Queued::closed);
}

TEST_F(SlcanPortTest, RubbishIsPassedOverAndToldWithItsPlace) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  const auto before = port->faults().count;
  adapter.put("t1232AA");      // broken off
  adapter.put("t1242BBCC\r");  // swallowed by it
  adapter.put("\xff\xfe\x01garbage\r" + std::string(5000, 'x') + "\r");
  adapter.put("t1252DDEE\r");
  ASSERT_TRUE(run_until([&] { return !ear_.frames.empty(); }));
  EXPECT_EQ(ear_.frames.size(), 1U);
  EXPECT_EQ(ear_.frames[0], can::Frame::base(0x125, {0xDD, 0xEE}));
  EXPECT_EQ(port->status().lost, 3U);
  EXPECT_EQ(port->faults().count, before + 3);
  EXPECT_GT(port->faults().at, 0U);
  EXPECT_TRUE(port->status().up);
}

// An adapter that means harm: answers that nobody asked for, confirmations of frames that were never given, lines cut
// anywhere, bytes that are no line. What waits stays bounded, each frame is confirmed once at most, and the port goes
// on.
TEST_F(SlcanPortTest, AHostileAdapterAtTheByteLevel) {
  Adapter adapter(path_, Style::lawicel);
  adapter.acknowledge = false;
  const auto port = open();
  ASSERT_TRUE(port);
  const std::array<std::string, 12> words{
      "\r",           "\a",      "z\r",         "Z\r",     "F81\r", "t1232AABB\r",
      "T1F9400000\r", "V1013\r", "t7E520401\r", "N1234\r", "t1239", std::string("\0\xff\x1b[2J", 6)};
  Random random(9);
  std::uint32_t tag = 0;
  for (int round = 0; round < 300; ++round) {
    std::string bytes;
    for (int i = 0; i < 20; ++i) {
      const std::string& word = words[random.below(words.size())];
      bytes += word.substr(0, 1 + random.below(word.size()));
    }
    adapter.put(bytes);
    if (port->send(can::Frame::base(0x7E5, {4, 1}), tag + 1) == can::Queued::yes) ++tag;
    for (int i = 0; i < 3; ++i) loop_.turn(1ms);
    ASSERT_LE(port->status().queued, 64U);
    ASSERT_LE(ear_.tags.size(), tag);
    ear_.frames.clear();
  }
  std::ranges::sort(ear_.tags);
  EXPECT_EQ(std::ranges::adjacent_find(ear_.tags), ear_.tags.end()) << "confirmed twice";
  adapter.acknowledge = true;
  adapter.put("\r\rt1252DDEE\r");
  EXPECT_TRUE(run_until([&] { return std::ranges::count(ear_.frames, can::Frame::base(0x125, {0xDD, 0xEE})) == 1; }));
}

TEST_F(SlcanPortTest, FlagsCount) {
  Adapter adapter(path_, Style::lawicel);
  adapter.flags = "F81\r";
  const auto port = open();
  ASSERT_TRUE(port);
  ASSERT_TRUE(run_until([&] { return port->flags() == 0x81; }));
  EXPECT_GE(port->status().errors, 1U);
  EXPECT_GE(port->status().lost, 1U);
  adapter.flags = "\a";  // it has none: not asked again
  adapter.forget();
  ASSERT_TRUE(run_until([&] { return adapter.heard("F"); }));
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 1), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return !ear_.tags.empty(); }));
}

TEST_F(SlcanPortTest, UnpluggedInTheMiddleOfAFrameAndBack) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  adapter.put("t1232A");
  run_for(50ms);
  adapter.unplug();
  ASSERT_TRUE(run_until([&] { return !ear_.ups.empty(); }));
  EXPECT_EQ(ear_.ups, std::vector<bool>{false});
  EXPECT_EQ(port->status().lost, 1U);
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 1), can::Queued::closed);
  run_for(600ms);  // it looks, and finds nothing
  EXPECT_FALSE(port->status().up);
  adapter.forget();
  adapter.plug();
  ASSERT_TRUE(run_until([&] { return ear_.ups.size() == 2; }));
  EXPECT_TRUE(ear_.ups[1]);
  EXPECT_EQ(adapter.commands(), (Texts{"C", "C", "V", "S4", "z0003", "O"}));
  adapter.put("t1231AB\r");
  ASSERT_TRUE(run_until([&] { return !ear_.frames.empty(); }));
  EXPECT_EQ(ear_.frames[0], can::Frame::base(0x123, {0xAB}));
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 9), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return !ear_.tags.empty(); }));
}

TEST_F(SlcanPortTest, AnotherBitRate) {
  Adapter adapter(path_, Style::lawicel);
  const auto port = open();
  ASSERT_TRUE(port);
  adapter.forget();
  EXPECT_FALSE(port->restart(123));
  EXPECT_TRUE(port->restart(500'000));
  EXPECT_FALSE(port->status().up);
  ASSERT_TRUE(run_until([&] { return port->status().up; }));
  EXPECT_TRUE(adapter.heard("S6"));
  EXPECT_EQ(port->status().bit_rate, 500'000U);
}

TEST_F(SlcanPortTest, WhatIsWrongIsTold) {
  const auto why = [&](const std::string& address, const SlcanOptions& options) {
    const auto port = SlcanPort::open(loop_, address, options);
    return port ? std::string("opened") : port.error();
  };
  EXPECT_NE(why("/dev/no-such-device", {}).find("no such device"), std::string::npos);
  EXPECT_NE(why("/dev/null", {}).find("no serial line"), std::string::npos);
  EXPECT_NE(why("/dev/ttyUSB0@12345", {}).find("DEVICE@SPEED"), std::string::npos);
  EXPECT_NE(why("/dev/ttyUSB0@", {}).find("DEVICE@SPEED"), std::string::npos);
  EXPECT_NE(why("@115200", {}).find("DEVICE@SPEED"), std::string::npos);
  EXPECT_NE(why(path_, {.bit_rate = 900'000}).find("900000 bit/s"), std::string::npos);
  Adapter adapter(path_, Style::lawicel);
  adapter.refuse_rate = true;
  EXPECT_NE(why(path_, {.bit_rate = 125'000, .timeout = 30s}).find("it refuses 125000 bit/s"), std::string::npos);
  adapter.refuse_rate = false;
  const auto first = open();
  EXPECT_NE(why(path_ + "@115200", {.timeout = 30s}).find("another program uses it"), std::string::npos);
}

}  // namespace
}  // namespace berth::io::slcan_tests
