// The bus of a network's manager: what it makes of error control frames, good and bad.
#include "tests/network/network_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using namespace std::chrono_literals;

namespace {

struct Listener final : ErrorControl {
  void boot_up(NodeId node, bool expected) noexcept override { add(node, expected ? "boot-up!" : "boot-up"); }
  void lost(NodeId node) noexcept override { add(node, "lost"); }
  void back(NodeId node) noexcept override { add(node, "back"); }
  void told(NodeId node, NmtState state) noexcept override { add(node, name(state)); }
  void overheard(const co::NmtRequest&) noexcept override {}
  void add(NodeId node, const char* what) { heard.push_back(std::to_string(node.value()) + " " + what); }
  std::vector<std::string> heard;
};

// No devices: frames as the test wants them.
struct BareBus {
  BareBus() { bus.lead_to(&listener); }
  void send(std::string_view frame) {
    other->send(*can::parse_frame(frame), 0);
    world.run_for(1ms);
  }
  template <class T>
  T get(rt::Task<T> task, rt::Duration limit = 10s) {
    struct Done final : rt::Job {
      void run() noexcept override { done = true; }
      bool done = false;
    } done;
    if (!task.start(world.executor(), done)) {
      EXPECT_TRUE(world.run_until([&] { return done.done; }, limit));
    }
    return task.take();
  }
  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> controller = wire.attach();
  std::unique_ptr<sim::Controller> other = wire.attach();
  can::Dispatcher dispatcher{world.executor(), *controller};
  Listener listener;
  ManagedBus bus{dispatcher};
};

}  // namespace

TEST(ManagedBus, FramesThatAreNoErrorControlAreNotHeard) {
  BareBus b;
  for (const auto* bad :
       {"705#", "705#7F00", "705#01", "705#7E", "705#R", "700#7F", "780#7F", "00000705#7F", "685#7F"}) {
    b.send(bad);
    EXPECT_TRUE(b.listener.heard.empty()) << bad << ": " << b.listener.heard.front();
  }
  b.send("705#7F");
  b.send("77F#85");  // the toggle bit of node guarding
  b.send("701#00");
  EXPECT_EQ(b.listener.heard, (std::vector<std::string>{"5 pre-operational", "127 operational", "1 boot-up"}));
}

TEST(ManagedBus, ABootUpIsExpectedOnceAfterAReset) {
  BareBus b;
  b.send("705#00");
  EXPECT_TRUE(b.get(b.bus.target(NodeId(5)).command(co::NmtCommand::reset_node)));
  b.send("706#00");
  b.send("705#00");
  b.send("705#00");
  EXPECT_TRUE(b.get(b.bus.command(co::NmtCommand::reset_communication, co::NmtTarget::all())));
  b.send("706#00");
  EXPECT_TRUE(b.get(b.bus.command(co::NmtCommand::start, co::NmtTarget::all())));
  b.send("706#00");
  EXPECT_EQ(b.listener.heard,
            (std::vector<std::string>{"5 boot-up", "6 boot-up", "5 boot-up!", "5 boot-up", "6 boot-up!", "6 boot-up"}));
}

TEST(ManagedBus, ABootUpIsWaitedForFromAMomentToAMoment) {
  BareBus b;
  auto& target = b.bus.target(NodeId(5));
  b.send("705#00");
  const auto after = b.world.now();
  EXPECT_TRUE(b.get(target.boots(after - 1ms, after)));
  EXPECT_FALSE(b.get(target.boots(after, after + 20ms)));
  EXPECT_EQ(b.world.now(), after + 20ms);
  b.world.after(5ms, [&] { b.other->send(*can::parse_frame("705#7F"), 0); });  // a heartbeat is none
  b.world.after(6ms, [&] { b.other->send(*can::parse_frame("706#00"), 0); });  // another's
  b.world.after(9ms, [&] { b.other->send(*can::parse_frame("705#00"), 0); });
  EXPECT_TRUE(b.get(target.boots(after, after + 50ms)));
  EXPECT_LT(b.world.now(), after + 31ms);
}

// Step 9 of the boot-up: a boot-up message is no heartbeat.
TEST(ManagedBus, AHeartbeatIsWaitedFor) {
  BareBus b;
  auto& target = b.bus.target(NodeId(5));
  b.world.after(5ms, [&] { b.other->send(*can::parse_frame("705#00"), 0); });
  EXPECT_EQ(b.get(target.heartbeat(20ms)), std::nullopt);
  b.world.after(5ms, [&] { b.other->send(*can::parse_frame("705#00"), 0); });
  b.world.after(6ms, [&] { b.other->send(*can::parse_frame("705#05"), 0); });
  EXPECT_EQ(b.get(target.heartbeat(20ms)), NmtState::operational);
}

TEST(ManagedBus, OneQuestionByNodeGuarding) {
  BareBus b;
  const auto began = b.world.now();
  EXPECT_EQ(b.get(b.bus.target(NodeId(5)).guard()), std::nullopt);
  EXPECT_GE(b.world.now() - began, 100ms);
  EXPECT_LT(b.world.now() - began, 110ms) << "one question";
  b.world.after(5ms, [&] { b.other->send(*can::parse_frame("705#84"), 0); });
  EXPECT_EQ(b.get(b.bus.target(NodeId(5)).guard()), NmtState::stopped);
}

// Lost, back; and a node that dies between the heartbeat that ended its boot-up and the next.
TEST(ManagedBus, SupervisionByHeartbeat) {
  BareBus b;
  auto& target = b.bus.target(NodeId(5));
  target.supervise({.assigned = true, .heartbeat = 100ms});
  b.world.run_for(150ms);
  EXPECT_EQ(b.listener.heard, std::vector<std::string>{"5 lost"}) << "never seen";
  b.send("705#05");
  b.send("705#05");
  EXPECT_EQ(b.listener.heard.size(), 4U);
  EXPECT_EQ(std::ranges::count(b.listener.heard, "5 back"), 1);
  b.world.run_for(150ms);
  EXPECT_EQ(b.listener.heard.back(), "5 lost");
  target.supervise({});
  b.send("705#05");
  b.world.run_for(1s);
  EXPECT_EQ(b.listener.heard.back(), "5 operational") << "not supervised any more";
}
