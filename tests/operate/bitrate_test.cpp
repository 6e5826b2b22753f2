// A whole network to another bit rate: together or not at all.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/operate/network_bitrate.hpp"
#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using operate::BitRateOptions;
using operate::BitRateReport;
using End = BitRateReport::End;

namespace {

rt::Task<void> run(operate::Network& network, const BitRateOptions& options, BitRateReport& report, bool& over) {
  report = co_await operate::move_bit_rate(network, options);
  over = true;
}

/// Three devices with node-IDs 2, 3 and 4 at 125 kbit/s, and Berth without its main job.
class BitRate : public ::testing::Test {
 protected:
  void make() {
    for (unsigned i = 0; i < 3; ++i) {
      auto& d = add_device(plant_, std::string(1, static_cast<char>('a' + i)), type_b, 0x10 + i);
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(static_cast<std::uint8_t>(2 + i));
      d.heartbeat = 100ms;
      if (change_) change_(d);
    }
    Findings findings;
    const std::vector<plant::BusRate> rates{{"backbone", 125'000}};
    world_ = plant::World::make(plant_, rates, findings);
    ASSERT_TRUE(world_);
    world_->start();
    port_ = world_->attach_master("backbone");
    network_ = std::make_unique<operate::Network>(world_->executor(), *port_, machine_.name, machine_.buses.front(),
                                                  std::vector<places::SlotSpec>{}, store_, operate::NetworkObserver{});
    ASSERT_TRUE(network_->open());
    world_->sim().run_for(500ms);
  }
  BitRateReport move(std::uint32_t rate, bool confirmed = true) {
    BitRateOptions options;
    options.rate = rate;
    options.confirmed = confirmed;
    BitRateReport report;
    bool over = false;
    rt::Scope scope(world_->executor());
    scope.spawn(run(*network_, options, report, over));
    EXPECT_TRUE(world_->sim().run_until([&] { return over; }, 10min));
    return report;
  }
  // The moment the devices are told to change.
  void when_told(std::function<void()> act) {
    class Watch final : public can::Tap {
     public:
      Watch(sim::Bus& bus, std::function<void()> act) : bus_(bus), act_(std::move(act)) { bus_.add_tap(*this); }
      ~Watch() { bus_.remove_tap(*this); }
      void frame(const can::Frame& f, rt::Time, int) noexcept override {
        if (f.id == 0x7E5 && f.data[0] == 0x15 && act_) bus_.world().after(10ms, std::exchange(act_, {}));
      }

     private:
      sim::Bus& bus_;
      std::function<void()> act_;
    };
    watch_ = std::shared_ptr<void>(new Watch(*world_->bus("backbone"), std::move(act)),
                                   [](void* w) { delete static_cast<Watch*>(w); });
  }
  [[nodiscard]] std::vector<std::uint32_t> rates() const {
    std::vector<std::uint32_t> all;
    for (const auto& t : world_->truth()) all.push_back(t.bit_rate);
    return all;
  }
  [[nodiscard]] std::vector<std::uint32_t> stored() const {
    std::vector<std::uint32_t> all;
    for (const auto& d : world_->devices())
      all.push_back(lss::bit_rate(d->device().lss().persistent().bit_rate).value_or(0));
    return all;
  }
  static std::string words(const BitRateReport& r) {
    std::string text = std::string(name(r.end)) + ": " + r.reason;
    for (const auto& n : r.nodes) text += "; " + std::to_string(n.id.value()) + " " + n.problem;
    return text;
  }
  using Rates = std::vector<std::uint32_t>;

  design::Machine machine_ = one_bus(125'000);
  plant::PlantFile plant_ = one_bus_plant(1);
  std::function<void(plant::PlantDevice&)> change_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<operate::Network> network_;
  std::shared_ptr<void> watch_;
};

}  // namespace

TEST_F(BitRate, AllMoveAndStore) {
  make();
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::moved) << words(report);
  EXPECT_EQ(report.rate, 250'000U);
  EXPECT_EQ(report.nodes.size(), 3U);
  EXPECT_EQ(rates(), (Rates{250'000, 250'000, 250'000}));
  EXPECT_EQ(stored(), (Rates{250'000, 250'000, 250'000}));
  // And it is kept.
  for (const char* name : {"a", "b", "c"}) {
    world_->find(name)->power(false);
    world_->find(name)->power(true);
  }
  world_->sim().run_for(1s);
  EXPECT_EQ(rates(), (Rates{250'000, 250'000, 250'000}));
}

TEST_F(BitRate, WithoutConfirmationNothingIsChanged) {
  make();
  const auto report = move(250'000, false);
  EXPECT_EQ(report.end, End::unconfirmed) << words(report);
  EXPECT_EQ(report.nodes.size(), 3U);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
  EXPECT_EQ(port_->bit_rate(), 125'000U);
  EXPECT_EQ(world_->find("a")->device().lss().pending().bit_rate, lss::BitRateIndex::kbit_125);
}

TEST_F(BitRate, ADeviceWithoutLssIsNamedAndNothingIsChanged) {
  change_ = [](plant::PlantDevice& d) {
    if (d.name == "b") d.speaks = {};
  };
  make();
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::refused) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_TRUE(report.nodes[0].problem.empty());
  EXPECT_NE(report.nodes[1].problem.find("does not speak LSS"), std::string::npos) << words(report);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
}

TEST_F(BitRate, ADeviceWithoutInquiriesMovesToo) {
  change_ = [](plant::PlantDevice& d) {
    if (d.name == "b") d.lss.without = {lss::Lackable::inquire_identity, lss::Lackable::inquire_node_id};
  };
  make();
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::moved) << words(report);
  EXPECT_EQ(stored(), (Rates{250'000, 250'000, 250'000}));
}

TEST_F(BitRate, ADeviceWithoutBitTimingIsNamedAndNothingIsChanged) {
  change_ = [](plant::PlantDevice& d) {
    if (d.name == "b") d.lss.without = {lss::Lackable::bit_timing};
  };
  make();
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::refused) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_FALSE(report.nodes[1].problem.empty());
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
}

// 15h has no answer: that it is not obeyed shows when the device is not heard at the new rate.
TEST_F(BitRate, ADeviceWithoutActivateIsNamedAndTheOthersAreBroughtBack) {
  change_ = [](plant::PlantDevice& d) {
    if (d.name == "b") {
      d.lss.without = {lss::Lackable::activate};
      d.heartbeat = 0ms;
    }
  };
  make();
  const auto report = move(250'000);
  EXPECT_TRUE(report.end == End::brought_back || report.end == End::lost) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_NE(report.nodes[1].problem.find("not heard"), std::string::npos) << words(report);
  EXPECT_EQ(stored(), (Rates{125'000, 125'000, 125'000}));
}

TEST_F(BitRate, AnOperationalDeviceIsNamedAndNothingIsChanged) {
  make();
  port_->send(can::Frame::base(0x000, {0x01, 0x03}), 0);
  world_->sim().run_for(300ms);
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::refused);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_NE(report.nodes[1].problem.find("operational"), std::string::npos) << words(report);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
}

// The advice leads on: a device that is stopped answers no SDO and could not tell its LSS address, one that is
// pre-operational can be moved (CiA 301 §7.3.2.2: SDO in pre-operational and operational alone).
TEST_F(BitRate, TheAdviceForAnOperationalDeviceWorks) {
  make();
  port_->send(can::Frame::base(0x000, {0x01, 0x03}), 0);
  world_->sim().run_for(300ms);
  const auto refused = move(250'000);
  ASSERT_EQ(refused.end, End::refused);
  EXPECT_NE(refused.nodes[1].problem.find("berth nmt preop"), std::string::npos) << words(refused);
  EXPECT_EQ(refused.nodes[1].problem.find("stop"), std::string::npos) << words(refused);
  port_->send(can::Frame::base(0x000, {0x80, 0x03}), 0);
  world_->sim().run_for(300ms);
  const auto moved = move(250'000);
  EXPECT_EQ(moved.end, End::moved) << words(moved);
  EXPECT_EQ(rates(), (Rates{250'000, 250'000, 250'000}));
}

// By heartbeat and by guarding.
TEST_F(BitRate, AStoppedDeviceIsToldApartFromOneWithoutIdentity) {
  change_ = [](plant::PlantDevice& d) {
    if (d.name == "c") d.heartbeat = 0ms;
  };
  make();
  port_->send(can::Frame::base(0x000, {0x02, 0x00}), 0);
  world_->sim().run_for(300ms);
  const auto refused = move(250'000);
  ASSERT_EQ(refused.end, End::refused);
  for (std::uint8_t id = 2; id <= 4; ++id) {
    const auto told = [&](const BitRateReport::Node& node) {
      return node.id == NodeId(id) && node.problem.find("stopped") != std::string::npos &&
             node.problem.find("berth nmt preop") != std::string::npos;
    };
    EXPECT_TRUE(std::ranges::any_of(refused.nodes, told)) << words(refused);
  }
  port_->send(can::Frame::base(0x000, {0x80, 0x00}), 0);
  world_->sim().run_for(300ms);
  const auto moved = move(250'000);
  EXPECT_EQ(moved.end, End::moved) << words(moved);
}

// Without heartbeat the state comes by guarding.
TEST_F(BitRate, AnOperationalDeviceWithoutHeartbeatIsSeenToo) {
  change_ = [](plant::PlantDevice& d) { d.heartbeat = 0ms; };
  make();
  port_->send(can::Frame::base(0x000, {0x01, 0x04}), 0);
  world_->sim().run_for(300ms);
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::refused);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_NE(report.nodes[2].problem.find("operational"), std::string::npos) << words(report);
}

// Answers 13h with "not supported": whoever was told before gets the old rate back as pending.
TEST_F(BitRate, ADeviceThatDoesNotKnowTheRateIsNamed) {
  make();
  world_->find("b")->device().set_blank(NodeId(3), 126'000);  // a rate outside CiA's table: it takes none by LSS
  world_->find("b")->reset();
  world_->sim().run_for(500ms);
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::refused) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_NE(report.nodes[1].problem.find("does not support"), std::string::npos) << words(report);
  EXPECT_TRUE(report.nodes[0].problem.empty()) << words(report);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
  EXPECT_EQ(world_->find("a")->device().lss().pending().bit_rate, lss::BitRateIndex::kbit_125);
}

// Gone for good: named, and the others are back.
TEST_F(BitRate, WhoDiesOnTheWayIsNamed) {
  make();
  when_told([this] { world_->find("c")->unplug(); });
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::lost) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  EXPECT_FALSE(report.nodes[2].heard);
  EXPECT_NE(report.nodes[2].problem.find("not heard"), std::string::npos);
  EXPECT_TRUE(report.nodes[0].heard);
  EXPECT_TRUE(report.nodes[1].heard);
  const auto now = rates();
  EXPECT_EQ(now[0], 125'000U);
  EXPECT_EQ(now[1], 125'000U);
}

// Reset between the command and the change: it stays at the old rate, and jams the new one. Whatever comes of it, it is
// over in bounded bus time, nothing was stored, and the way out that the error names is one: power off and on.
TEST_F(BitRate, WhoStaysBehindDoesNotHoldTheMoveForEver) {
  machine_.buses.front().timing.boot_timeout = 1s;
  make();
  when_told([this] { world_->find("c")->reset(); });
  const auto began = world_->executor().now();
  const auto report = move(250'000);
  const auto took = world_->executor().now() - began;
  EXPECT_LT(took, 12s) << words(report);  // four steps of 1.9 s each, and what is under way then
  EXPECT_EQ(report.rate, 125'000U) << words(report);
  EXPECT_TRUE(report.end == End::brought_back || report.end == End::lost) << words(report);
  ASSERT_EQ(report.nodes.size(), 3U);
  for (const auto& node : report.nodes) {
    EXPECT_FALSE(node.stored);
    const bool told = node.problem.find("heard again at the old") != std::string::npos ||
                      node.problem.find("heard at the old") != std::string::npos;
    EXPECT_NE(node.heard, told) << words(report);
  }
  EXPECT_FALSE(report.nodes[2].moved);
  EXPECT_NE(report.nodes[2].problem.find("not heard"), std::string::npos) << words(report);
  EXPECT_EQ(stored(), (Rates{125'000, 125'000, 125'000}));
  for (const char* name : {"a", "b", "c"}) world_->find(name)->power(false);
  for (const char* name : {"a", "b", "c"}) world_->find(name)->power(true);
  world_->sim().run_for(2s);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
}

// All were heard, the first has stored, the second cannot: the first stores the old rate again.
TEST_F(BitRate, WhoCannotStoreBringsAllBack) {
  make();
  world_->find("b")->memory().broken(true);
  const auto report = move(250'000);
  EXPECT_EQ(report.end, End::brought_back) << words(report);
  EXPECT_EQ(report.rate, 125'000U);
  ASSERT_EQ(report.nodes.size(), 3U);
  for (const auto& node : report.nodes) {
    EXPECT_TRUE(node.moved);
    EXPECT_TRUE(node.heard);
    EXPECT_FALSE(node.stored);
  }
  EXPECT_NE(report.nodes[1].problem.find("does not store"), std::string::npos) << words(report);
  EXPECT_EQ(rates(), (Rates{125'000, 125'000, 125'000}));
  EXPECT_EQ(stored(), (Rates{125'000, 125'000, 125'000}));
  EXPECT_EQ(world_->find("a")->memory().writes_ended(), 2U);
}

TEST_F(BitRate, RatesThatLssDoesNotKnow) {
  make();
  EXPECT_EQ(move(100'000).end, End::refused);
  EXPECT_EQ(move(125'000).end, End::refused) << "it is there";
}
