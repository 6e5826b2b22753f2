// For 1,000 random addresses the request count equals what the rule says: the traces go to tools/fastscan-count, which
// knows the rule and nothing of Berth (S4.6, S4.7, S4.14).
#include <gtest/gtest.h>
#include <unistd.h>
#include <chrono>
#include <cstdint>
#include <string>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "../paths.hpp"
#include "../shell.hpp"
#include "berth/base/random.hpp"
#include "berth/lss/fastscan.hpp"
#include "lss_world.hpp"

namespace berth::lss::test {
namespace {

struct Kind {
  const char* name;
  FastscanForm form;
  Feedback feedback;
};
constexpr std::array<Kind, 5> kinds{{{"standard", FastscanForm::standard, Feedback::none},
                                     {"merged", FastscanForm::merged, Feedback::none},
                                     {"literal", FastscanForm::literal, Feedback::none},
                                     {"feedback-29", FastscanForm::standard, Feedback::extended},
                                     {"feedback-11", FastscanForm::standard, Feedback::base}}};

/// One scan as candump writes it, its head before it.
std::string scan(const LssAddress& address, const Kind& kind) {
  World w;
  w.master->set_options({.feedback_base = default_feedback_base});
  w.add_slave({.address = address, .feedback = kind.feedback}, microseconds(500));
  const Record record(w.bus);
  const FastscanOptions options{
      .form = kind.form, .feedback = kind.feedback, .window = milliseconds(3), .confirm = false};
  Fastscan fastscan(*w.master, options);
  const auto found = w.run(fastscan.scan());
  EXPECT_TRUE(found && *found && (*found)->address == address) << to_string(address);
  std::string text = "# scan " + to_string(address) + ' ' + kind.name + '\n';
  for (std::size_t i = 0; i < record.text.size(); ++i) {
    std::array<char, 32> time{};
    const auto us = std::chrono::duration_cast<microseconds>(record.times[i].time_since_epoch()).count();
    std::snprintf(time.data(), time.size(), "(%010lld.%06lld)", static_cast<long long>(us / 1'000'000),
                  static_cast<long long>(us % 1'000'000));
    text += std::string(time.data()) + " can0 " + record.text[i] + '\n';
  }
  return text;
}

berth::test::Ran count(const std::string& log) {
  const auto path = std::filesystem::path(::testing::TempDir()) / ("fastscan-" + std::to_string(::getpid()) + ".log");
  std::ofstream(path) << log;
  const auto counted =
      berth::test::shell(berth::test::source_dir() + "/tools/fastscan-count " + path.string() + " 2>&1");
  std::filesystem::remove(path);
  return counted;
}

LssAddress random_address(Random& random) {
  const auto part = [&] { return static_cast<std::uint32_t>(random.below(std::uint64_t{1} << 32)); };
  const auto vendor = part();
  const auto product = part();
  const auto revision = part();
  return {vendor, product, revision, part()};
}

TEST(FastscanCount, S4_6_S4_7_S4_14_AThousandRandomAddresses) {
  Random random(305);
  std::string log;
  for (unsigned i = 0; i < 1000; ++i) {
    const auto address = random_address(random);
    for (const auto form : {0U, 1U}) log += scan(address, kinds[form]);
    if (i % 10 == 0) {
      for (const auto form : {2U, 3U, 4U}) log += scan(address, kinds[form]);
    }
  }
  const auto counted = count(log);
  EXPECT_EQ(counted.status, 0) << counted.out;
  EXPECT_NE(counted.out.find("2300 scans"), std::string::npos) << counted.out;
}

// The counter can find fault: a request too few, an answer too many, a part that was not confirmed, no scan.
TEST(FastscanCount, TheCounterFindsWhatIsWrong) {
  const LssAddress address{0x0135'5341, 0x0447'0003, 0x0002'0006, 0xFEED'F00D};
  const auto good = scan(address, kinds[2]);
  EXPECT_EQ(count(good).status, 0);
  // Paper 4's figures: 132 requests.
  EXPECT_NE(count(good).out.find("1 scans, 132 requests, 0 faults"), std::string::npos);
  const auto without = [&](const std::string& frame) {
    auto text = good;
    const auto at = text.find(frame);
    const auto begin = text.rfind('\n', at) + 1;
    return text.erase(begin, text.find('\n', at) + 1 - begin);
  };
  EXPECT_EQ(count(without("7E5#51000000001F0000")).status, 1);
  EXPECT_EQ(count(without("7E4#4F")).status, 1);
  EXPECT_EQ(count(good + good.substr(good.rfind("\n(") + 1)).status, 1);
  auto wrong = good;
  wrong.replace(wrong.find("FEEDF00D"), 8, "FEEDF00F");
  EXPECT_EQ(count(wrong).status, 1);
  auto standard = good;
  standard.replace(standard.find("literal"), 7, "standard");
  EXPECT_EQ(count(standard).status, 1);
  EXPECT_EQ(count("").status, 1);
}

}  // namespace
}  // namespace berth::lss::test
