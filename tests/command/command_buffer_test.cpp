// The two command buffers of a manager: the application's own, and that which SDO clients write (1023h).
#include "berth/command/command_buffer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/thread_commands.hpp"
#include "berth/command/verbs.hpp"
#include "berth/design/command_words.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/sim/world.hpp"

namespace berth::command {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr TypeCode type{0x11, 0x22};

/// A machine of one slot and its device, without a plant file.
class World {
 public:
  /// `verbs`: what the machine file lets nodes command.
  explicit World(std::vector<std::string> verbs = {"report", "sdo read", "sdo write"})
      : sim_(7), bus_(sim_.add_bus("field", 250'000)) {
    machine_.name = "m";
    design::Bus bus;
    bus.name = "field";
    bus.bitrate = 250'000;
    bus.commands.verbs = std::move(verbs);
    machine_.buses.push_back(bus);
    design::Slot slot;
    slot.spec.name = {"m", "field", "left"};
    slot.spec.id = NodeId(5);
    slot.spec.type = type;
    machine_.slots.push_back(slot);
    device_port_ = bus_.attach({.name = "left"});
    device_dispatcher_ = std::make_unique<can::Dispatcher>(sim_.executor(), *device_port_);
    device_ = std::make_unique<device::Device>(
        *device_dispatcher_, device::minimal_description(), nullptr,
        device::Options{
            .address = {type.vendor, type.product, 0, 9}, .source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
    master_port_ = bus_.attach({.name = "master"});
    stranger_port_ = bus_.attach({.name = "stranger"});
    stranger_dispatcher_ = std::make_unique<can::Dispatcher>(sim_.executor(), *stranger_port_);
    client_ = std::make_unique<co::SdoClient>(*stranger_dispatcher_);
    session_ = std::make_unique<tree::Session>(sim_.executor(), machine_, store_);
  }
  bool begin() {
    if (!session_->connect("field", *master_port_) || !session_->open()) return false;
    device_->power_on();
    session_->start();
    return sim_.run_until([this] { return session_->operational() && session_->idle(); }, 60s);
  }
  /// 0: taken, else the abort code.
  std::uint32_t write(const std::string& text) {
    std::optional<Result<void>> done;
    scope_.spawn([](co::SdoClient& client, std::string line, auto& into) -> rt::Task<void> {
      const std::vector<std::uint8_t> bytes(line.begin(), line.end());
      into = co_await client.download(NodeId(127), 0x1023, 1, bytes);
    }(*client_, text, done));
    sim_.run_until([&] { return done.has_value(); }, 5s);
    return !done ? 1 : *done ? 0 : done->error().detail;
  }
  std::vector<std::uint8_t> read(std::uint8_t sub) {
    std::optional<Result<co::SdoValue>> got;
    scope_.spawn([](co::SdoClient& client, std::uint8_t s, auto& into) -> rt::Task<void> {
      into = co_await client.upload(NodeId(127), 0x1023, s);
    }(*client_, sub, got));
    sim_.run_until([&] { return got.has_value(); }, 20s);
    if (!got || !*got) return {};
    const auto bytes = (*got)->bytes();
    return {bytes.begin(), bytes.end()};
  }
  unsigned status() {
    const auto bytes = read(2);
    return bytes.empty() ? 0x100U : bytes[0];
  }
  /// Until its confirmation is there.
  json reply() {
    for (int i = 0; i < 200 && status() == 0xFF; ++i) sim_.run_for(50ms);
    const auto bytes = read(3);
    return json::parse(bytes.begin(), bytes.end(), nullptr, false);
  }
  tree::Session& session() { return *session_; }
  device::Device& device() { return *device_; }
  sim::World& sim() { return sim_; }

 private:
  sim::World sim_;
  sim::Bus& bus_;
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<sim::Controller> device_port_, master_port_, stranger_port_;
  std::unique_ptr<can::Dispatcher> device_dispatcher_, stranger_dispatcher_;
  std::unique_ptr<device::Device> device_;
  std::unique_ptr<co::SdoClient> client_;
  std::unique_ptr<tree::Session> session_;
  rt::Scope scope_{sim_.executor()};
};

}  // namespace

// S5.24: local commands, each confirmed under its number, in their order.
TEST(CommandBuffer, S5_24_ConfirmsEachCommand) {
  World world;
  ASSERT_TRUE(world.begin());
  CommandBuffer buffer(world.session());
  const auto read = buffer.put({"sdo read", {{"node", "5"}, {"object", "1018h:02"}}});
  const auto unknown = buffer.put({"no such", {}});
  ASSERT_TRUE(read && unknown);
  EXPECT_EQ(*unknown, *read + 1);
  EXPECT_FALSE(buffer.take()) << "nothing is done within the call";
  ASSERT_TRUE(world.sim().run_until([&] { return buffer.waiting() == 0; }, 5s));
  const auto first = buffer.take();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->number, *read);
  EXPECT_EQ(first->reply.status, 0) << first->reply.error;
  EXPECT_NE(first->reply.json.find("34"), std::string::npos) << first->reply.json;
  const auto second = buffer.take();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->number, *unknown);
  EXPECT_EQ(second->reply.status, 2);
  EXPECT_FALSE(buffer.take());
}

TEST(CommandBuffer, IsBounded) {
  World world;
  ASSERT_TRUE(world.begin());
  CommandBuffer buffer(world.session());
  for (std::size_t i = 0; i < CommandBuffer::most; ++i) ASSERT_TRUE(buffer.put({"report", {}}));
  EXPECT_FALSE(buffer.put({"report", {}}));
  ASSERT_TRUE(world.sim().run_until([&] { return buffer.waiting() == 0; }, 5s));
  EXPECT_FALSE(buffer.put({"report", {}})) << "the confirmations wait to be taken";
  EXPECT_TRUE(buffer.take());
  EXPECT_TRUE(buffer.put({"report", {}}));
}

// S5.24: four threads fill the buffer while the manager's own runs: each command is confirmed once, to a number that
// was given.
TEST(ThreadCommands, S5_24_AnyThreadMayFillTheBuffer) {
  World world;
  ASSERT_TRUE(world.begin());
  io::Loop loop(world.sim().executor());
  ThreadCommands commands(world.session(), loop);
  ASSERT_TRUE(commands.good());
  constexpr int threads = 4;
  constexpr int each = 25;
  std::mutex lock;
  std::multiset<std::uint32_t> given, confirmed;
  std::map<std::uint32_t, int> wanted, got;
  std::atomic<int> taken = 0;
  std::vector<std::thread> running;
  for (int t = 0; t < threads; ++t) {
    running.emplace_back([&, t] {
      for (int i = 0; i < each; ++i) {
        // Every other one is refused, which its status says.
        const bool good = (t + i) % 2 == 0;
        const Request request{good ? "sdo read" : "no such", {{"node", "5"}, {"object", "1018h:02"}}};
        std::optional<std::uint32_t> number;
        while (!number) {
          if ((number = commands.put(request))) break;
          std::this_thread::yield();
          if (const auto done = commands.wait(1ms)) {
            const std::lock_guard hold(lock);
            confirmed.insert(done->number);
            got[done->number] = done->reply.status;
            ++taken;
          }
        }
        const std::lock_guard hold(lock);
        given.insert(*number);
        wanted[*number] = good ? 0 : 2;
      }
      while (taken < threads * each) {
        if (const auto done = commands.wait(1ms)) {
          const std::lock_guard hold(lock);
          confirmed.insert(done->number);
          got[done->number] = done->reply.status;
          ++taken;
        }
      }
    });
  }
  while (taken < threads * each) loop.turn(1ms);
  for (auto& thread : running) thread.join();
  EXPECT_EQ(given, confirmed);
  EXPECT_EQ(wanted, got);
  EXPECT_EQ(std::set<std::uint32_t>(given.begin(), given.end()).size(), given.size());
  EXPECT_FALSE(commands.take());
}

TEST(ThreadCommands, TheBufferIsBoundedUntilConfirmationsAreTaken) {
  World world;
  ASSERT_TRUE(world.begin());
  io::Loop loop(world.sim().executor());
  ThreadCommands commands(world.session(), loop);
  for (std::size_t i = 0; i < CommandBuffer::most; ++i) ASSERT_EQ(commands.put({"report", {}}), i + 1);
  EXPECT_FALSE(commands.put({"report", {}}));
  EXPECT_FALSE(commands.take()) << "nothing is done before the loop runs";
  std::optional<CommandBuffer::Confirmation> done;
  while (!done) {
    loop.turn(1ms);
    done = commands.take();
  }
  EXPECT_EQ(done->number, 1U);
  EXPECT_TRUE(commands.put({"report", {}}));
}

// S5.23: the remote buffer reads and writes objects of local and remote nodes.
TEST(RemoteCommands, S5_23_AClientReadsADeviceThroughTheManager) {
  World world;
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  ASSERT_EQ(world.status(), 0U);
  ASSERT_EQ(world.write(R"({"verb": "sdo read", "arguments": {"node": "5", "object": "1018h:02"}})"), 0U);
  const json reply = world.reply();
  EXPECT_EQ(world.status(), 1U) << reply;
  EXPECT_NE(reply.dump().find("34"), std::string::npos) << reply;
  ASSERT_EQ(world.write(R"({"verb": "report"})"), 0U);
  const json report = world.reply();
  EXPECT_EQ(report.at("slots").at(0).at("state"), "operational") << report;
  ASSERT_EQ(world.write(R"({"verb": "sdo write", "arguments": {"node": "5", "object": "1017h", "value": "700"}})"), 0U);
  EXPECT_FALSE(world.reply().contains("error"));
  EXPECT_EQ(world.device().values().get_or<std::uint16_t>({0x1017, 0}, 0), 700) << "the remote node has it";
  // What the device refuses is confirmed as that.
  ASSERT_EQ(world.write(R"({"verb": "sdo write", "arguments": {"node": "5", "object": "1018h:02", "value": "1"}})"),
            0U);
  EXPECT_NE(world.reply().dump().find("06010002"), std::string::npos) << world.reply();
  EXPECT_EQ(world.status(), 3U);
}

// S5.23: the local buffer controls the network and stores configuration data; the confirmation of each comes when it is
// done, and the devices are so.
TEST(CommandBuffer, S5_23_CommandsOfTheApplicationReachTheDevices) {
  World world;
  ASSERT_TRUE(world.begin());
  CommandBuffer buffer(world.session());
  const auto done = [&](Request request) {
    const auto number = buffer.put(std::move(request));
    EXPECT_TRUE(world.sim().run_until([&] { return buffer.waiting() == 0; }, 10s));
    auto confirmation = buffer.take();
    EXPECT_TRUE(confirmation && number && confirmation->number == *number);
    return confirmation ? confirmation->reply : Reply{};
  };
  EXPECT_EQ(done({"nmt", {{"command", "stop"}, {"node", "left"}}}).status, 0);
  ASSERT_TRUE(world.sim().run_until([&] { return world.device().state() == NmtState::stopped; }, 2s));
  EXPECT_EQ(done({"nmt", {{"command", "start"}, {"node", "left"}}}).status, 0);
  ASSERT_TRUE(world.sim().run_until([&] { return world.device().state() == NmtState::operational; }, 2s));
  const auto written = done({"sdo write", {{"node", "5"}, {"object", "1017h"}, {"value", "640"}}});
  EXPECT_EQ(written.status, 0) << written.error;
  EXPECT_EQ(world.device().values().get_or<std::uint16_t>({0x1017, 0}, 0), 640);
  const auto reset = done({"nmt", {{"command", "reset-node"}, {"node", "left"}}});
  EXPECT_EQ(reset.status, 0) << reset.error;
  EXPECT_NE(world.device().state(), NmtState::operational) << "it boots";
  EXPECT_TRUE(world.sim().run_until([&] { return world.session().operational(); }, 20s)) << "and is started again";
  const auto state = json::parse(done({"report", {}}).json);
  EXPECT_EQ(state.at("slots").at(0).at("state"), "operational") << state;
}

TEST(RemoteCommands, BadCommandsAreConfirmedAsSuch) {
  World world;
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  for (const char* const text :
       {"{", "[]", R"({"verb": "no such"})", R"({"verb": "report", "arguments": {"bus": "other"}})",
        R"({"verb": "sdo read", "arguments": {"node": "77", "object": "1000h"}})"}) {
    ASSERT_EQ(world.write(text), 0U) << text;
    const json reply = world.reply();
    EXPECT_EQ(world.status(), 3U) << text;
    EXPECT_TRUE(reply.contains("error")) << text << " " << reply;
  }
  ASSERT_EQ(world.write(R"({"verb": "report", "arguments": {"bus": "other"}})"), 0U);
  EXPECT_NE(world.reply().dump().find("a command from a bus is only for that bus"), std::string::npos);
  EXPECT_EQ(world.write(std::string(2000, 'x')), 0x0607'0012U) << "longer than the buffer";
  ASSERT_EQ(world.write(R"({"verb": "report"})"), 0U) << "it works on";
}

// A node of the bus may be anybody's: what a person may do is not its right.
TEST(RemoteCommands, ANodeCommandsNothingUnlessTheMachineFileSaysSo) {
  World world(std::vector<std::string>{});
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  for (const Verb& verb : verbs()) {
    EXPECT_EQ(world.write(json{{"verb", verb.name}}.dump()), 0x0800'0021U) << verb.name;
    EXPECT_EQ(world.status(), 0U) << verb.name;
  }
  const auto history = world.session().store().history(std::nullopt);
  ASSERT_TRUE(history);
  EXPECT_TRUE(std::ranges::none_of(*history, [](const auto& h) { return h.event == "commanded by a node"; }));
}

TEST(RemoteCommands, ANodeCommandsOnlyWhatIsListed) {
  for (const Verb& allowed : verbs()) {
    World world(std::vector<std::string>{std::string(allowed.name)});
    ASSERT_TRUE(world.begin());
    const RemoteCommands remote(world.session());
    for (const Verb& verb : verbs()) {
      if (verb.name == allowed.name) continue;
      ASSERT_EQ(world.write(json{{"verb", verb.name}}.dump()), 0U) << verb.name;
      const json reply = world.reply();
      EXPECT_EQ(world.status(), 3U) << verb.name;
      EXPECT_NE(reply.dump().find("[bus.field.commands] does not list it"), std::string::npos) << reply;
      world.sim().run_for(100ms);
    }
  }
}

// Whatever is listed: no file of this computer goes out in frames, and a confirmation is a person's.
TEST(RemoteCommands, NoPathAndNoConfirmationComesFromANode) {
  std::vector<std::string> all;
  for (const Verb& verb : verbs()) all.emplace_back(verb.name);
  World world(all);
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  for (const Verb& verb : verbs()) {
    for (const char* const argument : {"file", "yes", "from-scratch"}) {
      ASSERT_EQ(world.write(json{{"verb", verb.name}, {"arguments", {{argument, "1"}}}}.dump()), 0U) << verb.name;
      const json reply = world.reply();
      EXPECT_EQ(world.status(), 3U) << verb.name;
      EXPECT_NE(reply.dump().find("not a node"), std::string::npos) << reply;
      world.sim().run_for(100ms);
    }
  }
}

// What a verb names of this computer is called "file", here and in what comes later: the rule above knows this name.
TEST(RemoteCommands, EveryCommandHasItsWordInTheMachineFile) {
  std::vector<std::string_view> names;
  for (const Verb& verb : verbs()) names.push_back(verb.name);
  EXPECT_TRUE(std::ranges::equal(names, design::command_words));
}

TEST(RemoteCommands, EachStandsInTheHistory) {
  World world;
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  ASSERT_EQ(world.write(R"({"verb": "report"})"), 0U);
  const auto history = world.session().store().history(std::nullopt);
  ASSERT_TRUE(history && !history->empty());
  EXPECT_EQ(history->back().event, "commanded by a node");
  EXPECT_EQ(history->back().reason, R"(1023h:01 = {"verb": "report"})");
}

// A node that writes without end does not fill the disk.
TEST(RemoteCommands, ManyCommandsAreRefused) {
  World world;
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  unsigned taken = 0;
  const rt::Time began = world.sim().executor().now();
  while (world.sim().executor().now() < began + 20s) {
    if (world.write("{") == 0) ++taken;
  }
  EXPECT_LE(taken, 32U + 201U);
  const auto history = world.session().store().history(std::nullopt);
  ASSERT_TRUE(history);
  EXPECT_EQ(std::ranges::count(*history, "commanded by a node", &places::HistoryEntry::event), taken);
}

TEST(RemoteCommands, OneAtATime) {
  World world;
  ASSERT_TRUE(world.begin());
  const RemoteCommands remote(world.session());
  ASSERT_EQ(world.write(R"({"verb": "sdo read", "arguments": {"node": "88", "object": "1000h"}})"), 0U);
  EXPECT_EQ(world.status(), 0xFFU) << "a node that is silent takes its time";
  EXPECT_EQ(world.write(R"({"verb": "report"})"), 0x0800'0022U);
  EXPECT_TRUE(world.reply().contains("error"));
  EXPECT_EQ(world.write(R"({"verb": "report"})"), 0U);
}

}  // namespace berth::command
