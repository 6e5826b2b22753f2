// The SDO manager (docs/sdo-manager.md): channels between devices by plain writes to both, leases, what a lost party
// leaves, a manager that starts anew; and never one CAN-ID in two channels.
#include "berth/manager/sdo_manager.hpp"

#include "berth/base/random.hpp"
#include "berth/co/sdo_servers.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "tests/network/network_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using namespace std::chrono_literals;

namespace {

constexpr unsigned channels = 2;  // of each kind, in each device
constexpr std::uint16_t server_base = 0x1201, client_base = 0x1280;

void add_channel(od::DescriptionBuilder& b, std::uint16_t index) {
  const auto none = od::Literal::number(co::CobId::invalid_bit);
  b.object(index, od::ObjectCode::record, "SDO parameter");
  b.sub(index, {.sub = 1, .name = "COB-ID client to server", .initial = none});
  b.sub(index, {.sub = 2, .name = "COB-ID server to client", .initial = none});
  b.sub(index, {.sub = 3, .name = "Node-ID", .type = od::DataType::unsigned8});
}

const std::shared_ptr<const od::Description>& channel_description() {
  static const auto made = [] {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "Peer", .heartbeat_ms = 100});
    device::add_storage(b);
    for (std::uint16_t i = 0; i < channels; ++i) {
      add_channel(b, static_cast<std::uint16_t>(server_base + i));
      add_channel(b, static_cast<std::uint16_t>(client_base + i));
    }
    b.variable(0x2000, {.name = "Limit"});
    return b.build();
  }();
  return made;
}

struct Ended {
  bool done = false;
  Result<SdoConnection> result = fail(Errc::cancelled, "not done");
};

rt::Task<void> connect(SdoManager& manager, NodeId client, NodeId server, rt::Duration lease, Ended& into) {
  const auto result = co_await manager.connect(client, server, lease);
  into.result = result;
  into.done = true;
}
rt::Task<void> disconnect(SdoManager& manager, NodeId client, NodeId server, Result<void>& into) {
  into = co_await manager.disconnect(client, server);
}
rt::Task<void> recover(SdoManager& manager, bool& done) {
  co_await manager.recover();
  done = true;
}

// Devices 1 to `count`, and a manager.
struct SdoRig : can::Tap {
  explicit SdoRig(std::uint8_t count = 3, SdoManagerOptions wanted = {.heartbeat = 350ms})
      : options(std::move(wanted)) {
    wire.add_tap(*this);
    for (std::uint8_t id = 1; id <= count; ++id) {
      peers[id] = std::make_unique<Station>(world, wire, id, channel_description());
      peers[id]->on();
      options.nodes.push_back(NodeId(id));
    }
    begin();
  }
  ~SdoRig() { wire.remove_tap(*this); }
  // A manager like a new process: it knows nothing.
  void begin() {
    scope.cancel();
    manager.reset();
    client.emplace(dispatcher, co::SdoOptions{.timeout = 50ms});
    manager.emplace(dispatcher, *client, options);
    world.run_for(20ms);
    bool done = false;
    scope.spawn(recover(*manager, done));
    EXPECT_TRUE(world.run_until([&] { return done; }, 30s));
  }
  Result<SdoConnection> connect_now(std::uint8_t from, std::uint8_t to, rt::Duration lease = 60s) {
    Ended ended;
    scope.spawn(connect(*manager, NodeId(from), NodeId(to), lease, ended));
    EXPECT_TRUE(world.run_until([&] { return ended.done; }, 10s));
    return ended.result;
  }
  Result<void> disconnect_now(std::uint8_t from, std::uint8_t to) {
    Result<void> result = fail(Errc::cancelled, "");
    scope.spawn(disconnect(*manager, NodeId(from), NodeId(to), result));
    world.run_until([&] { return result.has_value() || result.error().code != Errc::cancelled; }, 10s);
    return result;
  }
  [[nodiscard]] co::CobId cob_id(std::uint8_t node, std::uint16_t object, std::uint8_t sub) const {
    return co::CobId(peers.at(node)->device.values().get_or<std::uint32_t>({object, sub}, co::CobId::invalid_bit));
  }
  // Ends that are in use in devices that have power: (node, object).
  [[nodiscard]] std::size_t ends() const {
    std::size_t count = 0;
    for (const auto& [id, peer] : peers) {
      for (std::uint16_t i = 0; i < channels; ++i) {
        for (const std::uint16_t base : {server_base, client_base}) {
          const auto object = static_cast<std::uint16_t>(base + i);
          count += peer->device.powered() && cob_id(id, object, 1).valid() && cob_id(id, object, 2).valid() ? 1U : 0U;
        }
      }
    }
    return count;
  }
  // At every frame: each CAN-ID of the pool is in one server's channel and in one client's at most. What stands in a
  // node that was cut off when this manager began, nobody can know before it was read: such a node alone is left out.
  void frame(const can::Frame&, rt::Time, int) noexcept override {
    std::map<std::uint32_t, unsigned> of_servers, of_clients;
    for (const auto& [id, peer] : peers) {
      if (!peer->device.powered() || !manager || manager->unread(NodeId(id))) continue;
      for (std::uint16_t i = 0; i < channels; ++i) {
        for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
          const auto served = cob_id(id, static_cast<std::uint16_t>(server_base + i), sub);
          const auto used = cob_id(id, static_cast<std::uint16_t>(client_base + i), sub);
          if (served.valid() && ++of_servers[served.id()] > 1) ++twice;
          if (used.valid() && ++of_clients[used.id()] > 1) ++twice;
        }
      }
    }
  }

  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> controller = wire.attach({.queue_depth = 16, .rx_depth = 64});
  can::Dispatcher dispatcher{world.executor(), *controller};
  SdoManagerOptions options;
  std::map<std::uint8_t, std::unique_ptr<Station>> peers;
  std::optional<co::SdoClient> client;
  std::optional<SdoManager> manager;
  unsigned twice = 0;
  rt::Scope scope{world.executor()};
};

}  // namespace

TEST(SdoConnections, EachCanIdOnce) {
  SdoConnections table({0x680, 0x684});  // two pairs, and one left over
  EXPECT_EQ(table.free(), 2U);
  const auto first = table.take();
  ASSERT_TRUE(first);
  EXPECT_EQ(*first, (ConnectionIds{0x680, 0x681}));
  EXPECT_EQ(table.take(), (ConnectionIds{0x682, 0x683}));
  EXPECT_FALSE(table.take());
  table.hold(0x681, NodeId(4));
  table.put_back(*first);
  EXPECT_FALSE(table.take()) << "node 4 may have it still";
  table.unhold(NodeId(5));
  EXPECT_FALSE(table.take());
  table.unhold(NodeId(4));
  EXPECT_EQ(table.take(), first);
  EXPECT_FALSE(table.claim({0x680, 0x681})) << "taken";
  EXPECT_FALSE(table.claim({0x681, 0x682})) << "no pair";
  EXPECT_FALSE(table.claim({0x684, 0x685})) << "not in the pool";
  table.put_back(*first);
  EXPECT_TRUE(table.claim(*first));
}

// What stands in both parties, by hand from CiA 301 §7.5.2.33 and .34, and a transfer in the new channel.
TEST(SdoManager, AChannelBetweenTwoDevices) {
  SdoRig rig;
  const auto made = rig.connect_now(1, 2);
  ASSERT_TRUE(made) << describe(made.error());
  EXPECT_EQ(made->server_object, 0x1201);
  EXPECT_EQ(made->client_object, 0x1280);
  EXPECT_EQ(rig.cob_id(2, 0x1201, 1).raw(), 0x680U);
  EXPECT_EQ(rig.cob_id(2, 0x1201, 2).raw(), 0x681U);
  EXPECT_EQ(rig.cob_id(1, 0x1280, 1).raw(), 0x680U);
  EXPECT_EQ(rig.cob_id(1, 0x1280, 2).raw(), 0x681U);
  const auto channel = co::client_channel(rig.peers[1]->device.values(), 1);
  ASSERT_TRUE(channel);
  EXPECT_EQ(channel->server, NodeId(2));
  co::SdoChannelClient client(rig.peers[1]->dispatcher, channel->channel, channel->server);
  struct Done final : rt::Job {
    void run() noexcept override { done = true; }
    bool done = false;
  } done;
  auto write = client.write(0x2000, 0, std::uint32_t{77});
  ASSERT_FALSE(write.begin(rig.world.executor(), done));
  rig.world.run_for(50ms);
  ASSERT_TRUE(done.done);
  EXPECT_TRUE(write.await_resume());
  EXPECT_EQ(rig.peers[2]->device.values().get_or<std::uint32_t>({0x2000, 0}, 0), 77U);
  EXPECT_EQ(rig.manager->connections().all().size(), 1U);

  ASSERT_TRUE(rig.disconnect_now(1, 2));
  EXPECT_EQ(rig.ends(), 0U);
  EXPECT_EQ(rig.manager->connections().free(), 48U);
  EXPECT_EQ(rig.disconnect_now(1, 2).error().code, Errc::not_found);
}

TEST(SdoManager, SeveralRequestersAtOnce) {
  SdoRig rig;
  std::vector<Ended> all(6);
  std::size_t i = 0;
  for (std::uint8_t from = 1; from <= 3; ++from) {
    for (std::uint8_t to = 1; to <= 3; ++to) {
      if (from != to) rig.scope.spawn(connect(*rig.manager, NodeId(from), NodeId(to), 60s, all[i++]));
    }
  }
  ASSERT_TRUE(rig.world.run_until([&] { return std::ranges::all_of(all, &Ended::done); }, 10s));
  for (const auto& one : all) EXPECT_TRUE(one.result) << describe(one.result.error());
  EXPECT_EQ(rig.ends(), 12U);
  // The same again is the same connection.
  EXPECT_TRUE(rig.connect_now(1, 2));
  EXPECT_EQ(rig.ends(), 12U);
  EXPECT_EQ(rig.twice, 0U);
}

TEST(SdoManager, Refusals) {
  SdoRig rig(4);
  EXPECT_EQ(rig.connect_now(1, 1).error().code, Errc::invalid);
  ASSERT_TRUE(rig.connect_now(1, 2));
  ASSERT_TRUE(rig.connect_now(1, 3));
  const auto full = rig.connect_now(1, 4);  // both of its client channels are in use
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, Errc::not_found);
  EXPECT_EQ(full.error().node, 1);
  const auto nobody = rig.connect_now(2, 99);
  ASSERT_FALSE(nobody);
  EXPECT_EQ(nobody.error().code, Errc::timeout);
  EXPECT_EQ(rig.ends(), 4U);
  EXPECT_EQ(rig.manager->connections().free(), 46U);
}

// A node whose client channels cannot be written.
struct Refusing final : od::Hook {
  od::AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override {
    return od::AbortCode::device_state;
  }
};

TEST(SdoManager, AConnectionThatFailsLeavesNothing) {
  Refusing refusing;
  SdoRig rig;
  rig.peers.at(1)->device.values().attach(refusing, client_base, client_base + channels - 1);
  const auto refused = rig.connect_now(1, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::aborted);
  EXPECT_FALSE(rig.cob_id(2, server_base, 1).valid()) << "the server's end was written first";
  EXPECT_EQ(rig.ends(), 0U);
  EXPECT_EQ(rig.manager->connections().free(), 47U) << "kept: the client may have it until it is read";
  EXPECT_TRUE(rig.connect_now(3, 2)) << "the server has its channel again";
}

// A client whose channel can be taken out by half: COB-ID client to server stays as it is.
struct HalfRefusing final : od::Hook {
  od::AbortCode writing(const od::Values&, ObjectRef object, std::span<const std::uint8_t>) noexcept override {
    return object.sub == 1 ? od::AbortCode::device_state : od::AbortCode::none;
  }
};

TEST(SdoManager, ACanIdThatCouldNotBeTakenOutIsNotGivenAgain) {
  HalfRefusing refusing;
  SdoRig rig;
  const auto first = rig.connect_now(1, 2);
  ASSERT_TRUE(first);
  rig.peers.at(1)->device.values().attach(refusing, client_base, client_base);
  rig.disconnect_now(1, 2);
  EXPECT_TRUE(rig.cob_id(1, client_base, 1).valid());
  EXPECT_FALSE(rig.cob_id(1, client_base, 2).valid());
  const auto second = rig.connect_now(3, 2);
  ASSERT_TRUE(second);
  EXPECT_NE(second->ids.request, first->ids.request);
}

TEST(SdoManager, NoCanIdIsLeft) {
  SdoRig rig(3, {.pool = {0x680, 0x681}, .heartbeat = 350ms});
  ASSERT_TRUE(rig.connect_now(1, 2));
  EXPECT_EQ(rig.connect_now(2, 1).error().code, Errc::unsupported);
  ASSERT_TRUE(rig.disconnect_now(1, 2));
  EXPECT_TRUE(rig.connect_now(2, 1));
}

TEST(SdoManager, ALeaseEnds) {
  SdoRig rig;
  ASSERT_TRUE(rig.connect_now(1, 2, 2s));
  ASSERT_TRUE(rig.connect_now(2, 3, 9s));
  rig.world.run_for(1s);
  ASSERT_TRUE(rig.connect_now(1, 2, 3s));  // renewed
  rig.world.run_for(2s);
  EXPECT_EQ(rig.ends(), 4U);
  rig.world.run_for(2s);
  EXPECT_EQ(rig.ends(), 2U);
  rig.world.run_for(9s);
  EXPECT_EQ(rig.ends(), 0U);
}

TEST(SdoManager, WhatALostClientLeavesIsTakenBack) {
  SdoRig rig;
  ASSERT_TRUE(rig.connect_now(1, 2));
  rig.peers[1]->off();
  rig.world.run_for(2s);
  EXPECT_FALSE(rig.cob_id(2, 0x1201, 1).valid());
  EXPECT_TRUE(rig.manager->connections().all().empty());
  // Its CAN-IDs may stand in the lost one still.
  const auto other = rig.connect_now(3, 2);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->ids.request, 0x682U);
  rig.peers[1]->on();
  rig.world.run_for(1s);
  EXPECT_EQ(rig.manager->connections().free(), 47U);
}

// It did not lose power, but the bus: its end stands there still when it is back, and is taken out.
TEST(SdoManager, AClientThatWasCutOff) {
  SdoRig rig;
  ASSERT_TRUE(rig.connect_now(1, 2));
  sim::Controller* const cut[] = {rig.peers[1]->controller.get()};
  rig.wire.split(cut);
  rig.world.run_for(2s);
  EXPECT_TRUE(rig.cob_id(1, 0x1280, 1).valid());
  ASSERT_TRUE(rig.connect_now(3, 2));
  rig.wire.join();
  rig.world.run_for(2s);
  EXPECT_FALSE(rig.cob_id(1, 0x1280, 1).valid());
  EXPECT_EQ(rig.manager->connections().free(), 47U);
  EXPECT_EQ(rig.twice, 0U);
}

TEST(SdoManager, AServerThatBootedGetsItsEndAgain) {
  SdoRig rig;
  ASSERT_TRUE(rig.connect_now(1, 2));
  rig.peers[2]->device.apply(co::NmtCommand::reset_communication);
  ASSERT_TRUE(rig.world.run_until([&] { return !rig.cob_id(2, 0x1201, 1).valid(); }, 1s));
  rig.world.run_for(1s);
  EXPECT_EQ(rig.cob_id(2, 0x1201, 1).raw(), 0x680U);
  EXPECT_EQ(rig.cob_id(1, 0x1280, 1).raw(), 0x680U);
  // A client that booted asks again by itself.
  rig.peers[1]->device.apply(co::NmtCommand::reset_communication);
  rig.world.run_for(1s);
  EXPECT_EQ(rig.ends(), 0U);
  EXPECT_EQ(rig.manager->connections().free(), 48U);
}

// Whole connections go on, halves are taken out, and what was asked for before is known.
TEST(SdoManager, AManagerThatStartsAnew) {
  SdoRig rig;
  ASSERT_TRUE(rig.connect_now(1, 2));
  ASSERT_TRUE(rig.connect_now(3, 2));
  const auto clear = [&](std::uint8_t sub) {
    auto& values = rig.peers[3]->device.values();
    const std::uint32_t none = co::CobId::invalid_bit;
    static_cast<void>(values.set(ObjectRef{0x1280, sub}, none));
  };
  clear(1);
  clear(2);
  rig.begin();
  ASSERT_EQ(rig.manager->connections().all().size(), 1U);
  const auto kept = rig.manager->connections().all()[0];
  EXPECT_EQ(kept.client, NodeId(1));
  EXPECT_EQ(kept.server, NodeId(2));
  EXPECT_EQ(rig.ends(), 2U);
  const auto made = rig.connect_now(3, 1);
  ASSERT_TRUE(made);
  EXPECT_EQ(made->ids.request, 0x682U);
  ASSERT_TRUE(rig.disconnect_now(1, 2));
  EXPECT_EQ(rig.twice, 0U);
}

// One CAN-ID in two channels, by whatever mistake: neither is kept.
TEST(SdoManager, DoubledCanIdsAreTakenOut) {
  SdoRig rig;
  for (const std::uint8_t node : {std::uint8_t{2}, std::uint8_t{3}}) {
    auto& values = rig.peers[node]->device.values();
    ASSERT_EQ(values.set(ObjectRef{0x1201, 1}, std::uint32_t{0x690}), od::AbortCode::none);
    ASSERT_EQ(values.set(ObjectRef{0x1201, 2}, std::uint32_t{0x691}), od::AbortCode::none);
  }
  EXPECT_EQ(rig.ends(), 2U);
  rig.begin();
  EXPECT_EQ(rig.ends(), 0U);
  EXPECT_EQ(rig.manager->connections().free(), 48U);
}

// A client's channel leads to one of them: which of the two answers it, nobody can say.
TEST(SdoManager, AChannelWhoseCanIdsASecondServerHasIsNotAdopted) {
  SdoRig rig;
  const auto put = [&](std::uint8_t node, std::uint16_t object, std::uint8_t sub, std::uint32_t value) {
    auto& values = rig.peers[node]->device.values();
    if (sub == 3) return values.set(ObjectRef{object, sub}, static_cast<std::uint8_t>(value));
    return values.set(ObjectRef{object, sub}, value);
  };
  for (const auto& [node, object] : {std::pair{1, client_base}, {2, server_base}, {3, server_base}}) {
    ASSERT_EQ(put(static_cast<std::uint8_t>(node), object, 1, 0x690), od::AbortCode::none);
    ASSERT_EQ(put(static_cast<std::uint8_t>(node), object, 2, 0x691), od::AbortCode::none);
    ASSERT_EQ(put(static_cast<std::uint8_t>(node), object, 3, node == 1 ? 2 : 1), od::AbortCode::none);
  }
  EXPECT_EQ(rig.ends(), 3U);
  rig.begin();
  EXPECT_TRUE(rig.manager->connections().all().empty());
  EXPECT_EQ(rig.ends(), 0U);
  EXPECT_EQ(rig.manager->connections().free(), 48U);
}

// 6E0h: unheard unless it is allowed. Its two bytes are Berth's own reading.
TEST(SdoManager, TheDynamicRequest) {
  for (const bool hears : {false, true}) {
    SdoRig rig(3, {.heartbeat = 350ms, .hears_requests = hears});
    static_cast<void>(rig.peers[1]->dispatcher.send(can::Frame::base(0x6E0, {1, 2})));
    static_cast<void>(rig.peers[1]->dispatcher.send(can::Frame::base(0x6E0, {1, 0})));
    static_cast<void>(rig.peers[1]->dispatcher.send(can::Frame::base(0x6E0, {1, 2, 3})));
    rig.world.run_for(1s);
    EXPECT_EQ(rig.ends(), hears ? 2U : 0U);
  }
}

// A master's own objects, as a stranger uses them; and the standby master that takes over goes on with what it finds.
TEST(SdoRequests, ByTheObjectsOfTheActiveMaster) {
  SdoRig rig;
  rig.scope.cancel();
  rig.manager.reset();
  struct Master {
    Master(sim::World& world, sim::Bus& bus, std::uint8_t id)
        : station(world, bus, id, description(),
                  {{{0x1F80, 0}, 0x21U}, {{0x1F81, 1}, 0x15U}, {{0x1F81, 2}, 0x15U}, {{0x1F81, 3}, 0x15U}}),
          manager(
              std::make_unique<DictionaryManager>(station.dispatcher, station.device.values(),
                                                  [this](co::NmtCommand command) { station.device.apply(command); })) {
      station.device.on().state = [this, id](NmtState state) { manager->own_state(state, NodeId(id)); };
      station.on();
    }
    ~Master() { manager.reset(); }
    static std::shared_ptr<const od::Description> description() {
      od::DescriptionBuilder b;
      device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
      add_manager_objects(b, {.most = 3, .startup = 0x21, .longest_concise = 0, .flying = true, .sdo_manager = true});
      return b.build();
    }
    Station station;
    std::unique_ptr<DictionaryManager> manager;
  };
  auto first = std::make_unique<Master>(rig.world, rig.wire, std::uint8_t{10});
  struct Done final : rt::Job {
    void run() noexcept override { done = true; }
    bool done = false;
  };
  const auto write = [&](std::uint8_t to, std::uint16_t index, std::uint32_t value) {
    Done done;
    auto op = rig.client->write(NodeId(to), index, 0, value);
    if (!op.begin(rig.world.executor(), done)) rig.world.run_until([&] { return done.done; }, 1s);
    const auto result = op.await_resume();
    return result ? od::AbortCode::none : static_cast<od::AbortCode>(result.error().detail);
  };
  const auto state = [&](std::uint8_t of, std::uint8_t client) {
    Done done;
    auto op = rig.client->read<std::uint32_t>(NodeId(of), 0x1F10, client);
    if (!op.begin(rig.world.executor(), done)) rig.world.run_until([&] { return done.done; }, 1s);
    return op.await_resume().value_or(0xFFFF'FFFF);
  };
  rig.world.run_for(100ms);
  EXPECT_EQ(write(10, 0x1F00, 0x0201), od::AbortCode::device_state) << "not the active master yet";
  rig.world.run_for(5s);
  EXPECT_EQ(write(10, 0x1F00, 0x0101), od::AbortCode::invalid_value);
  EXPECT_EQ(write(10, 0x1F00, 0x0000'0201), od::AbortCode::none);
  rig.world.run_for(500ms);
  EXPECT_EQ(state(10, 1), 0x1280'0202U);
  EXPECT_EQ(rig.cob_id(2, 0x1201, 1).raw(), 0x680U);
  EXPECT_EQ(state(10, 3), 0U);

  const Master second(rig.world, rig.wire, std::uint8_t{11});
  rig.world.run_for(2s);
  first->manager->power_off();
  first->station.off();
  ASSERT_TRUE(rig.world.run_until([&] { return second.manager->flying().is_master(); }, 10s));
  rig.world.run_for(3s);
  EXPECT_EQ(rig.ends(), 2U);
  ASSERT_NE(second.manager->sdo_requests()->manager(), nullptr);
  EXPECT_EQ(second.manager->sdo_requests()->manager()->connections().all().size(), 1U);
  EXPECT_EQ(write(11, 0x1F00, 0x0203), od::AbortCode::none);
  rig.world.run_for(500ms);
  EXPECT_EQ(rig.cob_id(3, 0x1280, 1).raw(), 0x682U);
  EXPECT_EQ(write(11, 0x1F01, 0x0201), od::AbortCode::none);
  rig.world.run_for(500ms);
  EXPECT_EQ(state(11, 1) & 0xFFU, 4U);
  EXPECT_FALSE(rig.cob_id(2, 0x1201, 1).valid() && rig.cob_id(2, 0x1201, 1).id() == 0x680U);
  first.reset();
}

// Devices lose power or the bus and come back, requests come at any time, the manager is started anew: never a CAN-ID
// in two channels, and at the end nothing is left over.
TEST(SdoManager, RandomWorlds) {
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    SdoRig rig(4, {.pool = {0x680, 0x687}, .lease = 4s, .heartbeat = 350ms});
    rig.world.executor().perturb(seed);
    std::vector<std::unique_ptr<Ended>> asked;
    for (int step = 0; step < 40; ++step) {
      const auto node = static_cast<std::uint8_t>(1 + random.below(4));
      const auto other = static_cast<std::uint8_t>(1 + random.below(4));
      auto& peer = *rig.peers[node];
      switch (random.below(6)) {
        case 0: peer.device.powered() ? peer.off() : peer.on(); break;
        case 1: {
          sim::Controller* const cut[] = {peer.controller.get()};
          rig.wire.split(cut);
          break;
        }
        case 2: rig.wire.join(); break;
        case 3:
          if (random.below(4) == 0) rig.begin();
          break;
        default: {
          auto& ended = *asked.emplace_back(std::make_unique<Ended>());
          rig.scope.spawn(
              connect(*rig.manager, NodeId(node), NodeId(other), std::chrono::seconds(1 + random.below(5)), ended));
        }
      }
      rig.world.run_for(std::chrono::milliseconds(random.below(900)));
    }
    rig.wire.join();
    for (auto& [id, peer] : rig.peers) {
      if (!peer->device.powered()) peer->on();
    }
    rig.world.run_for(20s);
    EXPECT_EQ(rig.ends(), 0U);
    EXPECT_EQ(rig.manager->connections().free(), 4U);
    EXPECT_EQ(rig.twice, 0U);
    rig.scope.cancel();
    if (HasFailure()) break;
  }
}
