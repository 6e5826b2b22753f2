// The image that two processes share: by the C interface, in a process of its own that is killed at any instruction,
// and memory that holds anything.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "../pch.hpp"
#include "berth/process/process.h"
#include "berth/process/shared_image.hpp"

namespace berth::process {
namespace {

using od::DataType;

std::string own_name(const char* word) { return std::string("test-") + word + "-" + std::to_string(::getpid()); }

std::string why_not(const std::string& name) {
  std::array<char, 300> why{};
  auto* const opened = berth_process_open(name.c_str(), why.data(), why.size());
  if (opened != nullptr) berth_process_close(opened);
  return opened != nullptr ? "opened" : why.data();
}

/// A process that does `work`, and ends.
template <class Work>
pid_t process(Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  return child;
}

void kill_and_wait(pid_t child) {
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

constexpr int many = 100;

Layout many_of_each() {
  Layout layout;
  for (int i = 0; i < many; ++i) {
    (void)layout.output<std::uint64_t>("out " + std::to_string(i));
    (void)layout.input<std::uint64_t>("in " + std::to_string(i));
  }
  return layout;
}

berth_variable variable(const berth_process* image, const std::string& name) {
  berth_variable found{};
  EXPECT_TRUE(berth_process_find(image, name.c_str(), &found)) << name;
  return found;
}

/// Reads every output and sets every input, as fast as it can, for ever. Exits with 1 at a snapshot that is torn.
void run_application(const std::string& name) {
  auto* image = berth_process_open(name.c_str(), nullptr, 0);
  if (image == nullptr) ::_exit(2);
  std::array<berth_variable, many> out{};
  std::array<berth_variable, many> in{};
  for (int i = 0; i < many; ++i) {
    if (!berth_process_find(image, ("out " + std::to_string(i)).c_str(), &out[i])) ::_exit(3);
    if (!berth_process_find(image, ("in " + std::to_string(i)).c_str(), &in[i])) ::_exit(3);
  }
  for (std::int64_t n = 1;; ++n) {
    berth_process_refresh(image);
    const auto now = berth_process_integer(image, &out[0]);
    for (const auto& each : out) {
      if (berth_process_integer(image, &each) != now) ::_exit(1);
    }
    for (const auto& each : in) berth_process_set_integer(image, &each, n);
    berth_process_commit(image);
  }
}

// S5.25 across processes: the application is killed at any instruction, 200 times, and started anew, while the network
// publishes and takes: neither ever sees a torn image.
TEST(SharedImage, S5_25_AnApplicationThatIsKilledTearsNothing) {
  const auto name = own_name("killed");
  const auto layout = many_of_each();
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  auto& mine = (*image)->network();
  std::vector<Output<std::uint64_t>> out;
  std::vector<Input<std::uint64_t>> in;
  for (int i = 0; i < many; ++i) {
    out.push_back(layout.handle<std::uint64_t, Direction::output>("out " + std::to_string(i)));
    in.push_back(layout.handle<std::uint64_t, Direction::input>("in " + std::to_string(i)));
  }
  std::uint64_t taken = 0;
  std::uint64_t torn = 0;
  std::uint64_t n = 0;
  constexpr int kills = 200;
  for (int round = 0; round < kills; ++round) {
    const pid_t child = process([&] { run_application(name); });
    const auto wanted = taken + 3 + round % 7;
    while (taken < wanted) {
      ++n;
      for (const auto& each : out) mine.set(each, n);
      mine.publish();
      int status = 0;
      ASSERT_EQ(::waitpid(child, &status, WNOHANG), 0) << "it ended: " << WEXITSTATUS(status);
      if (!mine.take()) continue;
      ++taken;
      for (const auto& each : in) torn += mine.get(each) != mine.get(in[0]) ? 1 : 0;
    }
    kill_and_wait(child);
  }
  EXPECT_EQ(torn, 0U);
  EXPECT_GE(taken, 3U * kills);
}

TEST(SharedImage, EachSideKnowsWhetherTheOtherIsThere) {
  const auto name = own_name("there");
  EXPECT_EQ(why_not(name), "process image \"" + name + "\": it is not there; start the program of the device first");
  Layout layout;
  (void)layout.output<std::uint8_t>("a");
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  EXPECT_FALSE((*image)->application());
  auto* const opened = berth_process_open(name.c_str(), nullptr, 0);
  ASSERT_NE(opened, nullptr);
  EXPECT_TRUE((*image)->application());
  EXPECT_EQ(why_not(name), "process image \"" + name + "\": another application uses it; only one at a time can");
  const auto second = SharedImage::create(name, layout);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error(), "process image \"" + name + "\": another process has it; end that, or take another name");
  EXPECT_TRUE(berth_process_connected(opened));
  image->reset();
  EXPECT_FALSE(berth_process_connected(opened));
  berth_process_close(opened);
  EXPECT_EQ(why_not(name), "process image \"" + name + "\": it is not there; start the program of the device first");
  EXPECT_EQ(why_not("../passwd"),
            "process image \"../passwd\": a name has letters, digits, \"-\", \"_\" and \".\", 100 at most");
}

// /dev/shm is everybody's: an image that another user offers is not opened.
TEST(SharedImage, AnotherUsersImageIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root: only root gives a file away";
  const auto name = own_name("user");
  Layout layout;
  (void)layout.output<std::uint8_t>("a");
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  const auto path = "/dev/shm/berth-" + name;
  ASSERT_EQ(::chown(path.c_str(), 65534, 65534), 0);
  EXPECT_EQ(why_not(name), "process image \"" + name + "\": it is another user's; run both programs as one user");
  ASSERT_EQ(::chown(path.c_str(), 0, 0), 0);
  EXPECT_EQ(why_not(name), "opened");
}

// The device's process is killed: the file stays, and is replaced by the next one; the application is told, and opens
// the new one.
TEST(SharedImage, ADeviceThatIsKilledIsKnownAndItsImageReplaced) {
  const auto name = own_name("device");
  Layout layout;
  const auto a = layout.output<std::uint8_t>("a");
  const pid_t device = process([&] {
    auto image = SharedImage::create(name, layout);
    if (!image) ::_exit(1);
    for (;;) ::pause();
  });
  berth_process* opened = nullptr;
  for (int i = 0; opened == nullptr && i < 1000; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    opened = berth_process_open(name.c_str(), nullptr, 0);
  }
  ASSERT_NE(opened, nullptr);
  EXPECT_TRUE(berth_process_connected(opened));
  kill_and_wait(device);
  EXPECT_FALSE(berth_process_connected(opened));
  EXPECT_EQ(why_not(name), "process image \"" + name + "\": it is not there; start the program of the device first");
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  EXPECT_FALSE(berth_process_connected(opened)) << "that is another one";
  auto* const anew = berth_process_open(name.c_str(), nullptr, 0);
  ASSERT_NE(anew, nullptr);
  (*image)->network().set(a, std::uint8_t{9});
  (*image)->network().publish();
  EXPECT_EQ(berth_process_refresh(opened), 0);
  EXPECT_EQ(berth_process_refresh(anew), 1);
  const auto its = variable(anew, "a");
  EXPECT_EQ(berth_process_integer(anew, &its), 9);
  berth_process_close(opened);
  berth_process_close(anew);
}

struct Range {
  DataType type;
  std::int64_t low;
  std::int64_t high;
};

// S5.6: the 18 types of network variables, in the image and by the C interface: their least and greatest values go
// both ways, and what is beyond is refused and changes nothing.
TEST(SharedImage, S5_6_AllTypesOfNetworkVariablesGoBothWays) {
  const auto bits = [](int n) { return (std::int64_t{1} << n) - 1; };
  constexpr auto most = std::numeric_limits<std::int64_t>::max();
  using enum DataType;
  const std::vector<Range> ranges{
      {boolean, 0, 1},
      {integer8, -128, 127},
      {integer16, -32768, 32767},
      {integer24, -8388608, 8388607},
      {integer32, -2147483648LL, 2147483647},
      {integer40, -bits(39) - 1, bits(39)},
      {integer48, -bits(47) - 1, bits(47)},
      {integer56, -bits(55) - 1, bits(55)},
      {integer64, -most - 1, most},
      {unsigned8, 0, 255},
      {unsigned16, 0, 65535},
      {unsigned24, 0, bits(24)},
      {unsigned32, 0, bits(32)},
      {unsigned40, 0, bits(40)},
      {unsigned48, 0, bits(48)},
      {unsigned56, 0, bits(56)},
      {unsigned64, 0, most},
      {real32, -16777216, 16777216},
  };
  ASSERT_EQ(ranges.size(), 18U);
  Layout layout;
  for (const auto& each : ranges) {
    ASSERT_TRUE(layout.declare("in " + std::string(od::name(each.type)), each.type, Direction::input));
    ASSERT_TRUE(layout.declare("out " + std::string(od::name(each.type)), each.type, Direction::output));
  }
  const auto name = own_name("types");
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  auto& network = (*image)->network();
  auto* const c = berth_process_open(name.c_str(), nullptr, 0);
  ASSERT_NE(c, nullptr);
  EXPECT_EQ(berth_process_count(c), 36U);
  for (const auto& each : ranges) {
    const std::string type(od::name(each.type));
    const auto in = variable(c, "in " + type);
    const auto out = variable(c, "out " + type);
    EXPECT_EQ(in.type, static_cast<std::uint16_t>(each.type));
    for (const auto value : {each.low, each.high}) {
      EXPECT_TRUE(berth_process_set_integer(c, &in, value)) << type;
      berth_process_commit(c);
      ASSERT_TRUE(network.take());
      const auto* const bytes = network.inputs().data() + in.offset;
      const auto raw = od::load(each.type, bytes);
      const auto got =
          each.type == real32 ? static_cast<std::int64_t>(od::real_of(real32, raw)) : static_cast<std::int64_t>(raw);
      EXPECT_EQ(got, value) << type;
      std::memcpy(network.outputs().data() + out.offset, bytes, in.size);
      network.publish();
      EXPECT_EQ(berth_process_refresh(c), 1);
      EXPECT_EQ(berth_process_integer(c, &out), value) << type;
      EXPECT_EQ(berth_process_real(c, &out), static_cast<double>(value)) << type;
    }
    EXPECT_FALSE(berth_process_set_integer(c, &out, 0)) << "an output is the network's";
    if (each.type == real32) continue;
    if (each.type != integer64 && each.type != unsigned64) {
      EXPECT_FALSE(berth_process_set_integer(c, &in, each.high + 1)) << type;
    }
    if (each.type != integer64) {
      EXPECT_FALSE(berth_process_set_integer(c, &in, each.low - 1)) << type;
    }
    EXPECT_FALSE(berth_process_set_real(c, &in, 1e30)) << type;
    EXPECT_FALSE(berth_process_set_real(c, &in, std::numeric_limits<double>::quiet_NaN())) << type;
    EXPECT_EQ(berth_process_integer(c, &in), each.high) << "nothing has changed";
  }
  const auto wide = variable(c, "in UNSIGNED64");
  EXPECT_TRUE(berth_process_set_real(c, &wide, 18446744073709549568.0));
  EXPECT_EQ(static_cast<std::uint64_t>(berth_process_integer(c, &wide)), 18446744073709549568ULL);
  const auto narrow = variable(c, "in INTEGER8");
  EXPECT_TRUE(berth_process_set_real(c, &narrow, -3.6));
  EXPECT_EQ(berth_process_integer(c, &narrow), -4);
  berth_process_close(c);
}

TEST(SharedImage, AgesCountOnWhenTheDeviceIsGone) {
  Layout layout;
  const auto a = layout.output<std::uint8_t>("a");
  const auto name = own_name("ages");
  auto image = SharedImage::create(name, layout);
  ASSERT_TRUE(image) << image.error();
  auto* const c = berth_process_open(name.c_str(), nullptr, 0);
  ASSERT_NE(c, nullptr);
  const auto its = variable(c, "a");
  EXPECT_EQ(berth_process_age_ns(c, &its), -1);
  auto& network = (*image)->network();
  network.received(a.number(), rt::Time(std::chrono::seconds(5)));
  network.set_now(rt::Time(std::chrono::seconds(7)));
  network.publish();
  EXPECT_EQ(berth_process_refresh(c), 1);
  EXPECT_EQ(berth_process_validity(c, &its), BERTH_GOOD);
  const auto first = berth_process_age_ns(c, &its);
  EXPECT_GE(first, 2'000'000'000);
  image->reset();
  std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_GE(berth_process_age_ns(c, &its), first + 2'000'000);
  berth_process_close(c);
}

/// The memory of an image of some variables.
std::vector<std::uint64_t> some_image(std::size_t& bytes) {
  Layout layout;
  (void)layout.output<std::uint16_t>("level");
  (void)layout.declare_at("far", DataType::unsigned8, Direction::output, 900'000);
  (void)layout.input<bool>("motor");
  const ImageFormat format(layout);
  bytes = format.size();
  std::vector<std::uint64_t> memory((bytes + 7) / 8);
  format.begin(reinterpret_cast<std::uint8_t*>(memory.data()));
  return memory;
}

RC_GTEST_PROP(SharedImage, MemoryThatHoldsAnythingIsReadOrRefused, ()) {
  static std::size_t bytes = 0;
  static const auto good = some_image(bytes);
  auto memory = good;
  auto* const begin = reinterpret_cast<std::uint8_t*>(memory.data());
  const auto changes = *rc::gen::inRange(0, 6);
  for (int i = 0; i < changes; ++i) begin[*rc::gen::inRange(4, 160)] = *rc::gen::arbitrary<std::uint8_t>();
  const auto size = *rc::gen::element(bytes, bytes - 1, std::size_t{63}, std::size_t{64}, std::size_t{0});
  const auto layout = read_layout({begin, size});
  if (changes == 0) RC_ASSERT(layout.has_value() == (size == bytes));
  if (!layout) return;
  const ImageFormat format(*layout);
  RC_ASSERT(format.size() <= size);
  // The words between the sides, too, may hold anything.
  format.outputs(begin)[0] = *rc::gen::arbitrary<std::uint8_t>();
  format.inputs(begin)[0] = *rc::gen::arbitrary<std::uint8_t>();
  ApplicationSide side(begin, format);
  NetworkSide network(begin, *layout, format);
  for (int i = 0; i < 3; ++i) {
    network.publish();
    side.refresh();
    side.commit();
    network.take();
  }
}

// A layout whose parts are far from each other: only what is declared is copied.
TEST(ImageFormat, OnlyWhatIsDeclaredIsHandedOver) {
  Layout layout;
  (void)layout.declare_at("a", DataType::unsigned32, Direction::output, 0);
  (void)layout.declare_at("b", DataType::unsigned32, Direction::output, 0x80000);
  (void)layout.declare_at("c", DataType::unsigned32, Direction::output, 0x80010);
  const ImageFormat format(layout);
  std::size_t copied = 0;
  for (const auto& run : format.outputs().runs) copied += run.size;
  // Heads, a gap of less than a line, "a"; then "b" to "c".
  EXPECT_EQ(copied, format.output_values_at() + 4 + 0x14);
  Image image(layout);
  const auto b = layout.handle<std::uint32_t, Direction::output>("b");
  const auto c = layout.handle<std::uint32_t, Direction::output>("c");
  image.network().set(b, 1U);
  image.network().set(c, 2U);
  image.network().publish();
  image.application().refresh();
  EXPECT_EQ(image.application().get(b), 1U);
  EXPECT_EQ(image.application().get(c), 2U);
}

}  // namespace
}  // namespace berth::process
