// Across the schemes: who sends what, told apart from each other (SX.1, S1.24), and in which order each finds devices
// (SX.2). The identifiers are written by hand from the papers and from docs/rand.md, docs/and.md, docs/claim.md.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/lss/frames.hpp"
#include "berth/research/and_frames.hpp"
#include "berth/research/and_master.hpp"
#include "berth/research/claim_frames.hpp"
#include "berth/research/negotiation_frames.hpp"
#include "berth/nodeid/rand_frames.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "rig.hpp"

namespace berth::device::test {
namespace {

using can::extended_flag;

struct Scheme {
  const char* name;
  can::IdRange by_hand;
  can::IdRange in_code;
};

const std::vector<Scheme>& schemes() {
  static const std::vector<Scheme> all{
      {"LSS answers and Fastscan's", can::only(0x7E4), can::only(lss::slave_cob_id)},
      {"LSS requests and Fastscan's", can::only(0x7E5), can::only(lss::master_cob_id)},
      {"RAND and resume requests", can::only(0x9F94'0000), nodeid::rand_requests},
      {"RAND IUS", {0x9F50'0000, 0x9F53'FFFF}, nodeid::ius_answers},
      {"RAND DIS", {0x9F90'0000, 0x9F93'FFFF}, nodeid::dis_answers},
      {"Fastscan feedback, 29 bits", {0x9F90'0000, 0x9F91'FFFF}, lss::extended_feedback},
      {"Fastscan feedback, 11 bits", {0x6D0, 0x6DF}, lss::base_feedback(lss::default_feedback_base)},
      {"AND requests", can::only(0x7C2), research::and_requests},
      {"AND answers", {0x7A0, 0x7C1}, research::and_answers},
      {"negotiation", {0x8000'0100, 0x8000'1FFF}, research::negotiation_frames},
      {"claims", {0x98EE'FF00, 0x98EE'FFFF}, research::claims},
      {"claim requests", {0x98EA'0000, 0x98EA'FFFF}, research::claim_requests},
  };
  return all;
}

bool overlap(can::IdRange a, can::IdRange b) { return a.first <= b.last && b.first <= a.last; }

TEST(Identifiers, SX_1_EachSchemeHasItsOwnButForDisAndFeedback) {
  for (const auto& a : schemes()) {
    EXPECT_EQ(a.by_hand, a.in_code) << a.name;
    for (const auto& b : schemes()) {
      if (&a >= &b) continue;
      const bool known = std::string(a.name) == "RAND DIS" && std::string(b.name) == "Fastscan feedback, 29 bits";
      EXPECT_EQ(overlap(a.by_hand, b.by_hand), known) << a.name << ", " << b.name;
    }
  }
}

// What CiA 301's predefined connection set uses is nobody's: PDOs 181h to 57Fh, SDO 581h to 67Fh, EMCY, error control.
TEST(Identifiers, SX_1_NoneIsOfThePredefinedConnectionSet) {
  const std::vector<can::IdRange> used{{0x000, 0x000}, {0x001, 0x001}, {0x071, 0x07F}, {0x080, 0x0FF}, {0x100, 0x180},
                                       {0x181, 0x57F}, {0x581, 0x67F}, {0x6E0, 0x6FF}, {0x701, 0x77F}};
  for (const auto& scheme : schemes()) {
    for (const auto& range : used) EXPECT_FALSE(overlap(scheme.by_hand, range)) << scheme.name << range.first;
  }
}

// One frame of each kind; each decoder takes its own and nobody else's, but for the pair that S1.24 names.
TEST(Identifiers, SX_1_S1_24_EveryDecoderTakesItsOwnOnly) {
  constexpr LssAddress a{0x0135'5341, 0x0447'0003, 0x0002'0006, 0xFEED'F00D};
  using I = nodeid::Identification;
  struct One {
    std::string scheme;
    can::Frame frame;
  };
  const std::vector<One> frames{
      {"lss", lss::request_fastscan({.id = 1, .bit_checked = 31})},
      {"lss", lss::answer(lss::Command::identified)},
      {"rand request", nodeid::iurs(3, 7)},
      {"rand request", nodeid::dirs(7)},
      {"rand request", nodeid::resume_request(7, a)},
      {"rand request", nodeid::switch_identification_selective(a, 2)},
      {"rand answer", nodeid::ius(0x0135)},
      {"rand answer", nodeid::dis(0x0134)},
      {"feedback", lss::feedback_frame({.kind = lss::Feedback::extended, .toggle = true, .value = 0x5341})},
      {"feedback", lss::feedback_frame({.kind = lss::Feedback::base, .toggle = false, .value = 9})},
      {"and request", research::and_iurs(4, research::AndAddress(a))},
      {"and request", research::and_switch_global(I::unknown)},
      {"and answer", research::and_ius(3)},
      {"and answer", research::and_dis(3)},
      {"and answer", research::and_address(a, 1)},
      {"negotiation", research::request_used()},
      {"negotiation", research::used(NodeId(32))},
      {"negotiation", research::identity(a, 12)},
      {"claim", research::claim({.id = 9, .name = research::claim_name(a)})},
      {"claim request", research::claim_request()},
  };
  for (const auto& [scheme, f] : frames) {
    std::vector<std::string> taken;
    if (lss::is_lss(f, lss::master_cob_id) || lss::is_lss(f, lss::slave_cob_id)) taken.emplace_back("lss");
    if (nodeid::decode_rand_request(f)) taken.emplace_back("rand request");
    if (nodeid::decode_rand_answer(f)) taken.emplace_back("rand answer");
    if (lss::decode_feedback(f, lss::default_feedback_base)) taken.emplace_back("feedback");
    if (research::decode_and_request(f)) taken.emplace_back("and request");
    if (research::decode_and_answer(f)) taken.emplace_back("and answer");
    if (research::decode_negotiation(f)) taken.emplace_back("negotiation");
    if (research::decode_claim(f)) taken.emplace_back("claim");
    if (research::decode_claim_request(f)) taken.emplace_back("claim request");
    if (f == nodeid::dis(0x0134)) {  // 1F9004D0h: DIS of 0134h, or the value 04D0h
      EXPECT_EQ(taken, (std::vector<std::string>{"rand answer", "feedback"}));
    } else {
      EXPECT_EQ(taken, std::vector<std::string>{scheme}) << can::to_string(f);
    }
  }
}

// S1.24: the receiver goes by its own procedure: in the window of an IURS no DIS counts, in that of a DIRS only the
// chunk that was asked.
TEST(Identifiers, S1_24_FeedbackInARandWindowIsNoDevice) {
  Rig rig;
  auto stranger = rig.bus.attach();
  can::Dispatcher dispatcher(rig.world.executor(), *rig.me);
  nodeid::RandMaster master(dispatcher);
  const nodeid::DiscoveryOptions options{.t_resp = milliseconds(4), .retries = 0};
  auto task = master.discover(options);
  struct Done final : rt::Job {
    void run() noexcept override {}
  } done;
  task.start(rig.world.executor(), done);
  for (int i = 0; i < 3; ++i) {
    rig.run(milliseconds(1));
    stranger->send(lss::feedback_frame({.kind = lss::Feedback::extended, .toggle = false, .value = 0x04D0}), 0);
  }
  rig.run(milliseconds(50));
  ASSERT_TRUE(task.done());
  const auto report = task.take();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->requests, 1U);
  EXPECT_TRUE(report->found.empty());
}

// ---- SX.2 ----------------------------------------------------------------------------------------------------------

constexpr LssAddress low_vendor{1, 0x0000'0009, 1, 0x0000'0300};    // first by numbers
constexpr LssAddress low_product{2, 0x0000'0001, 1, 0x0000'0200};   // first by product and serial number
constexpr LssAddress low_byte{0x0100'0000, 0x0000'0005, 1, 0x100};  // first by vendor's lowest byte: 0

struct Three {
  explicit Three(Options how) {
    for (const auto& address : {low_vendor, low_product, low_byte}) {
      how.address = address;
      how.negotiator.seed = address.serial;
      nodes.push_back(std::make_unique<Node>(rig.world, rig.bus, how));
      nodes.back()->on();
    }
    rig.run(milliseconds(2));
  }
  template <class T>
  T finish(rt::Task<T> task) {
    struct Done final : rt::Job {
      void run() noexcept override { is = true; }
      bool is = false;
    } done;
    done.is = task.start(rig.world.executor(), done);
    EXPECT_TRUE(rig.world.run_until([&] { return done.is; }, seconds(60)));
    return task.take();
  }
  Rig rig;
  std::vector<std::unique_ptr<Node>> nodes;
};

TEST(Identifiers, SX_2_RandFindsByNumbers) {
  Three t({});
  can::Dispatcher dispatcher(t.rig.world.executor(), *t.rig.me);
  nodeid::RandMaster master(dispatcher);
  const nodeid::DiscoveryOptions options;
  const auto report = t.finish(master.discover(options));
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 3U);
  EXPECT_EQ(report->found[0].address, low_vendor);
  EXPECT_EQ(report->found[1].address, low_product);
  EXPECT_EQ(report->found[2].address, low_byte);
}

TEST(Identifiers, SX_2_FastscanFindsTheLowestNumberToo) {
  Three t({});
  const auto scan = [&](std::uint32_t id, unsigned bit, unsigned sub, unsigned next) {
    const auto before = t.rig.record.count("7E4#4F00000000000000");
    t.rig.ask("7E5#51" + Rig::le32(id) + Rig::hex8(bit) + Rig::hex8(sub) + Rig::hex8(next), milliseconds(2));
    return t.rig.record.count("7E4#4F00000000000000") > before;
  };
  ASSERT_TRUE(scan(0, 0x80, 0, 0));
  std::array<std::uint32_t, 4> id{};
  for (unsigned sub = 0; sub < 4; ++sub) {
    for (unsigned bit = 32; bit-- > 0;) {
      if (!scan(id[sub], bit, sub, sub)) id[sub] |= 1U << bit;
    }
    ASSERT_TRUE(scan(id[sub], 0, sub, (sub + 1) % 4));
  }
  EXPECT_EQ((LssAddress{id[0], id[1], id[2], id[3]}), low_vendor);
}

TEST(Identifiers, SX_2_AndFindsByProductAndSerial) {
  Three t({.and_protocol = true});
  can::Dispatcher dispatcher(t.rig.world.executor(), *t.rig.me);
  research::AndMaster master(dispatcher);
  const research::AndOptions options;
  const auto report = t.finish(master.discover(options));
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 3U);
  EXPECT_EQ(report->found[0].address, low_product);
  EXPECT_EQ(report->found[1].address, low_byte);
  EXPECT_EQ(report->found[2].address, low_vendor);
}

TEST(Identifiers, SX_2_NegotiationGoesByTheLowestByteFirst) {
  Three t({.negotiation = NegotiationMode::on});
  t.rig.run(seconds(4));
  std::vector<std::pair<rt::Time, LssAddress>> booted;
  for (const auto& n : t.nodes) {
    const auto id = n->device.node_id();
    ASSERT_TRUE(id.configured());
    const auto at = t.rig.record.first("7" + Rig::hex8(id.value()) + "#00");
    ASSERT_TRUE(at);
    booted.emplace_back(*at, n->device.lss().address());
  }
  std::ranges::sort(booted);
  EXPECT_EQ(booted[0].second, low_byte);
  EXPECT_EQ(booted[1].second, low_vendor);
  EXPECT_EQ(booted[2].second, low_product);
}

}  // namespace
}  // namespace berth::device::test
