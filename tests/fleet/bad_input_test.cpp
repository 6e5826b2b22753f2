// What strangers, clocks, disks and brokers do to a machine at a broker, and to a host that watches it. (What a broker
// does to a connection: tests/mqtt; what a payload may be: tests/sparkplug.)
#include <cstdlib>

#include "berth/fleet/watch.hpp"
#include "fleet_rig.hpp"
#include "full_disk.hpp"
#include "tests/mqtt/certificates.hpp"

namespace berth::fleet::test {
namespace {

constexpr const char* sends_often = "publish = [{ object = \"Position value\", every = \"100 ms\" }]\n";
constexpr const char* position = "Signals/Position value";

/// `[mqtt]` with more lines.
std::string at_broker(const std::string& more) { return "[mqtt]\nbroker = \"mqtt://127.0.0.1\"\n" + more; }
const std::string obeys = at_broker("commands = [\"nmt\"]\n");

std::string written(const std::string& metric, sparkplug::DataType type, Value value) {
  sparkplug::Metric one;
  one.name = metric;
  one.type = type;
  one.value = std::move(value);
  Payload payload;
  payload.metrics.push_back(std::move(one));
  const auto bytes = sparkplug::encode(payload);
  return {bytes.begin(), bytes.end()};
}

/// Publishes it so often, as quickly as the broker takes it.
void flood(View& view, const std::string& topic, const std::string& bytes, int count) {
  for (int i = 0; i < count; ++i) {
    while (!view.station().publish(topic, bytes)) std::this_thread::sleep_for(1ms);
  }
}

/// A command of a host that is allowed, repeated until it is done: a flood before it may have used the pace up.
testing::AssertionResult obeys_again(Rig& rig, View& view) {
  unsigned looks = 0;
  return rig.until([&] {
    constexpr unsigned between = 25;
    if (looks++ % between == 0) view.command("left", "Commands/NMT", sparkplug::DataType::string, std::string("preop"));
    return view.cell("Commands/Done", 2) == "Commands/NMT";
  });
}

/// A host as `berth fleet` is one.
class Onlooker {
 public:
  explicit Onlooker(const Broker& broker, const sparkplug::Fleet::Limits& limits = {})
      : thread_(Thread::start().value()) {
    WatchOptions options{.connection = mqtt::test::quick(broker.where(), "onlooker"), .host = "onlooker", .groups = {}};
    options.groups = {"berth"};
    options.limits = limits;
    watch_ = Watch::start(*thread_, std::move(options), clock_, Random(8)).value();
  }
  /// The machine and this device are online, and nothing was missed.
  [[nodiscard]] bool sees(const std::string& device, const std::string& name = "line") const {
    bool there = false;
    watch_->look([&](const sparkplug::Fleet& fleet) {
      const auto* const node = fleet.find({"berth", name});
      const auto* const found = node == nullptr ? nullptr : fleet.find(*node, device);
      there = found != nullptr && node->self.online && !node->in_doubt && found->online;
    });
    return there;
  }
  [[nodiscard]] Watch& watch() { return *watch_; }

 private:
  std::unique_ptr<Thread> thread_;
  SystemClock clock_;
  std::unique_ptr<Watch> watch_;
};

/// While it lives, OpenSSL takes this file for the certificates of the system.
class SystemTrusts {
 public:
  explicit SystemTrusts(const std::string& file) { ::setenv("SSL_CERT_FILE", file.c_str(), 1); }
  ~SystemTrusts() { ::unsetenv("SSL_CERT_FILE"); }
  SystemTrusts(const SystemTrusts&) = delete;
  SystemTrusts& operator=(const SystemTrusts&) = delete;
};

/// Of each value of left's position: the time that it came with first.
std::map<std::uint64_t, std::uint64_t> times_of_values(View& view) {
  view.look();
  std::map<std::uint64_t, std::uint64_t> found;
  for (const auto& each : view.changes) {
    const auto* const value = std::get_if<std::uint64_t>(&each.value);
    if (each.device == "left" && each.metric == position && value != nullptr) found.try_emplace(*value, each.at);
  }
  return found;
}

/// Sets left's position to `first` up to `last`, one in each time that is published.
void turn_encoder(Rig& rig, std::uint32_t first, std::uint32_t last) {
  for (auto value = first; value <= last; ++value) {
    rig.set_position(rig.device_in("left").name(), value);
    rig.run(300ms);
    std::this_thread::sleep_for(5ms);
  }
}

testing::AssertionResult all_came(Rig& rig, View& view, std::uint32_t first, std::uint32_t last) {
  return rig.until([&] {
    const auto found = times_of_values(view);
    for (auto value = first; value <= last; ++value)
      if (!found.contains(value)) return false;
    return true;
  });
}

}  // namespace

// ---- strangers

// A broker gives a retained message to the machine at each connection. This one kept it over its own restart.
TEST(FleetBadInput, ARetainedCommandIsRefused) {
  NEEDS_BROKER();
  const Folder kept;
  Broker broker("persistence true\npersistence_location " + kept.file("") + "\n");
  {
    View stranger(broker);
    ASSERT_TRUE(stranger.station().publish("spBv1.0/berth/DCMD/line/left",
                                           written("Commands/NMT", sparkplug::DataType::string, std::string("stop")),
                                           mqtt::Qos::at_least_once, true));
    ASSERT_TRUE(stranger.station().heard.until([](const auto& story) { return !story.published.empty(); }));
  }
  broker.stop();
  Rig rig(machine_text(obeys, sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  broker.start();
  ASSERT_TRUE(rig.until([&] { return !rig.audited("retained").empty(); }));
  EXPECT_TRUE(rig.requests.empty());
  EXPECT_EQ(rig.slot("left").state, places::SlotState::operational);
}

TEST(FleetBadInput, CommandsOfTheWrongTypeAreRefusedWithTheReason) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(obeys, sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") > 0; }));
  const std::vector<std::pair<sparkplug::DataType, Value>> wrong{{sparkplug::DataType::uint32, std::uint64_t{5}},
                                                                 {sparkplug::DataType::boolean, true},
                                                                 {sparkplug::DataType::float64, 1.5},
                                                                 {sparkplug::DataType::string, sparkplug::Null{}}};
  std::size_t refused = 0;
  for (const auto& [type, value] : wrong) {
    view.command("left", "Commands/NMT", type, value);
    ++refused;
    ASSERT_TRUE(rig.until([&] { return rig.audited("refused").size() == refused; })) << refused;
    ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 2) == "Commands/NMT"; }));
    EXPECT_NE(view.cell("Commands/Refused", 4), "");
  }
  EXPECT_TRUE(rig.requests.empty());
  EXPECT_TRUE(obeys_again(rig, view));
}

class FleetBadInputOf : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Versions, FleetBadInputOf, testing::Values("5", "3.1.1"),
                         [](const auto& version) { return version.index == 0 ? "Mqtt5" : "Mqtt311"; });

TEST_P(FleetBadInputOf, AMegabyteIsNotTaken) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(obeys + "version = \"" + GetParam() + "\"\n", sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") > 0; }));
  const std::string content(1'000'000, 'x');
  const auto large = written("Commands/NMT", sparkplug::DataType::string, content);
  flood(view, "spBv1.0/berth/DCMD/line/left", large, 5);
  flood(view, "spBv1.0/berth/NCMD/line", large, 5);
  EXPECT_TRUE(obeys_again(rig, view));
  EXPECT_EQ(rig.told_of("connected to"), 1U) << rig.told();
  EXPECT_EQ(rig.audited(content.substr(0, 3)).size(), 0U);
}

TEST(FleetBadInput, RubbishFromStrangersChangesNothing) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(obeys, sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") > 0; }));
  const auto whole = written("Commands/NMT", sparkplug::DataType::string, std::string("stop"));
  std::vector<std::string> rubbish{"", "x", std::string(1000, '\xFF'), std::string("\x12\xFF\xFF\xFF\x7F", 5)};
  for (std::size_t length = 1; length < whole.size(); length += 3) rubbish.push_back(whole.substr(0, length));
  for (const auto& bytes : rubbish) {
    for (const auto* topic : {"spBv1.0/berth/NCMD/line", "spBv1.0/berth/DCMD/line/left", "spBv1.0/berth/DCMD/line/none",
                              "spBv1.0/STATE/scada", "spBv1.0/STATE/"})
      flood(view, topic, bytes, 1);
  }
  EXPECT_TRUE(obeys_again(rig, view));
  EXPECT_TRUE(std::ranges::all_of(rig.requests, [](const auto& request) { return request.verb == "nmt"; }));
  EXPECT_EQ(rig.told_of("connected to"), 1U) << rig.told();
  EXPECT_EQ(rig.slot("right").state, places::SlotState::operational);
}

// Each would be a birth of everything.
TEST(FleetBadInput, AFloodOfRebirthsAndOfHostsThatComeOnlineIsFewBirths) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(obeys, sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") > 0; }));
  const auto rebirth = written("Node Control/Rebirth", sparkplug::DataType::boolean, true);
  for (int i = 0; i < 300; ++i) {
    flood(view, "spBv1.0/berth/NCMD/line", rebirth, 1);
    flood(view, "spBv1.0/STATE/host-" + std::to_string(i), R"({"online":true,"timestamp":1})", 1);
    rig.run(20ms);
  }
  EXPECT_TRUE(obeys_again(rig, view));
  EXPECT_LT(view.count(MessageType::nbirth), 150U);
}

// ---- what a host hears

TEST(FleetBadInput, AWillThatComesAfterTheNewBirthChangesNothing) {
  NEEDS_BROKER();
  Broker broker;
  const Folder folder;
  View view(broker);
  const Onlooker host(broker);
  Rig rig(machine_text("", sends_often));
  const auto options = to(broker, folder.file("line.db.mqtt"));
  ASSERT_EQ(rig.publish(options), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return host.sees("left"); }));
  rig.fleet.reset();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ndeath) > 0 && !host.sees("left"); }));
  const auto death = std::ranges::find(view.said, MessageType::ndeath, &View::Said::type)->bytes;
  ASSERT_EQ(rig.publish(options), "");
  ASSERT_TRUE(rig.until([&] { return host.sees("left"); }));
  flood(view, "spBv1.0/berth/NDEATH/line", death, 3);
  // What comes behind it was heard, too.
  turn_encoder(rig, 5, 5);
  ASSERT_TRUE(all_came(rig, view, 5, 5));
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(host.sees("left"));
    rig.run(20ms);
    std::this_thread::sleep_for(2ms);
  }
}

TEST(FleetBadInput, AHostThatHearsRubbishAsksAndSeesAgain) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  view.hears_strangers = true;
  const Onlooker host(broker);
  Rig rig(machine_text("", sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return host.sees("left"); }));
  const auto births = view.count(MessageType::nbirth);
  for (const auto* topic : {"spBv1.0/berth/NDATA/line", "spBv1.0/berth/DDATA/line/left", "spBv1.0/berth/NBIRTH/line",
                            "spBv1.0/berth/NDEATH/line", "spBv1.0/STATE/onlooker"})
    flood(view, topic, std::string(100, '\xFF'), 20);
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::nbirth) > births && host.sees("left"); }));
}

// What a host keeps is bounded. Whoever looks is told that it is not all.
TEST(FleetBadInput, AHostOfTooManyMachinesSaysThatSomeAreLeftOut) {
  NEEDS_BROKER();
  Broker broker;
  Onlooker host(broker, {.nodes = 1});
  Rig one(machine_text("", "", "one"));
  ASSERT_EQ(one.publish(to(broker)), "");
  ASSERT_TRUE(one.until([&] { return host.sees("left", "one"); }));
  EXPECT_EQ(host.watch().status().left_out, "");
  Rig two(machine_text("", "", "two"));
  ASSERT_EQ(two.publish(to(broker)), "");
  ASSERT_TRUE(two.until([&] { return !host.watch().status().left_out.empty(); }));
  EXPECT_EQ(host.watch().status().left_out, "berth/two: there are more edge nodes than this host keeps");
  EXPECT_TRUE(host.sees("left", "one"));
}

// ---- clocks and disks

TEST(FleetBadInput, AClockThatIsSetBackLosesNothing) {
  NEEDS_BROKER();
  Broker broker;
  const Folder folder;
  View view(broker);
  Rig rig(machine_text("", sends_often));
  ASSERT_EQ(rig.publish(to(broker, folder.file("line.db.mqtt"))), "");
  ASSERT_TRUE(rig.up());
  turn_encoder(rig, 1, 5);
  ASSERT_TRUE(all_came(rig, view, 1, 5));
  rig.clock().set_by(-1h);
  turn_encoder(rig, 6, 10);
  ASSERT_TRUE(all_came(rig, view, 6, 10));
  broker.kill();
  ASSERT_TRUE(rig.until([&] { return rig.told_of("keeps what changes") > 0; }));
  turn_encoder(rig, 11, 15);
  rig.clock().set_by(-1h);
  turn_encoder(rig, 16, 20);
  broker.start();
  ASSERT_TRUE(view.station().heard.until([](const auto& s) { return s.is_connected() && s.connected.size() == 2; }));
  turn_encoder(rig, 21, 25);
  ASSERT_TRUE(all_came(rig, view, 1, 25));
  const auto at = times_of_values(view);
  EXPECT_LT(at.at(6), at.at(5)) << "the time is that of the computer";
  EXPECT_LT(at.at(16), at.at(15));
  for (const std::uint32_t value : {2U, 7U, 12U, 17U, 22U}) EXPECT_LT(at.at(value), at.at(value + 1)) << value;
}

TEST(FleetBadInput, ADiskThatIsFullWhileTheBrokerIsAwayLosesNothing) {
  NEEDS_BROKER();
  Broker broker;
  const Folder folder;
  View view(broker);
  Rig rig(machine_text("", sends_often));
  ASSERT_EQ(rig.publish(to(broker, folder.file("line.db.mqtt"))), "");
  ASSERT_TRUE(rig.up());
  turn_encoder(rig, 1, 2);
  ASSERT_TRUE(all_came(rig, view, 1, 2));
  broker.kill();
  ASSERT_TRUE(rig.until([&] { return rig.told_of("keeps what changes") > 0; }));
  std::uint32_t value = 2;
  {
    const FullDisk full(48U << 10U);
    while (rig.told_of("in memory alone") == 0 && value < 500) {
      turn_encoder(rig, value + 1, value + 1);
      ++value;
    }
    ASSERT_EQ(rig.told_of("in memory alone"), 1U) << rig.told();
    turn_encoder(rig, value + 1, value + 10);
    value += 10;
  }
  broker.start();
  ASSERT_TRUE(all_came(rig, view, 1, value));
}

// ---- brokers and hosts

TEST(FleetBadInput, AnExpiredCertificateIsSaidOnceAndARenewedOneIsTaken) {
  NEEDS_BROKER();
  const mqtt::test::Certificates made;
  // Who is trusted by this computer: a machine file may name no file outside its project.
  const SystemTrusts trusts(made.authorities());
  made.make("broker", "DNS:localhost,IP:127.0.0.1", "20200101000000Z", "20210101000000Z");
  Broker broker(made.listener("broker"));
  Rig rig(machine_text("", sends_often));
  ASSERT_EQ(rig.publish({.broker = mqtt::to_string(broker.where(true)), .backlog_file = {}, .version = "test"}), "");
  ASSERT_TRUE(rig.until([&] { return rig.told_of("expired") == 1; }));
  rig.run(3s);
  made.make("broker", "DNS:localhost,IP:127.0.0.1");
  broker.stop();
  broker.start();
  ASSERT_TRUE(rig.until([&] { return rig.told_of("connected to") == 1; }));
  EXPECT_EQ(rig.told_of("expired"), 1U) << rig.told();
}

// Its name may be a mistyped one: nothing is published, and nobody would know why.
TEST(FleetBadInput, APrimaryHostThatNeverSaysItIsOnlineIsSaid) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(at_broker("primary_host = \"scada\"\n"), sends_often));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return rig.told_of("the primary host \"scada\"") == 1; }));
  turn_encoder(rig, 1, 10);
  EXPECT_EQ(view.count(MessageType::nbirth), 0U);
  EXPECT_EQ(rig.told_of("the primary host \"scada\""), 1U) << "once";
  ASSERT_TRUE(view.station().publish("spBv1.0/STATE/scada", R"({"online":true,"timestamp":1})",
                                     mqtt::Qos::at_least_once, true));
  ASSERT_TRUE(all_came(rig, view, 1, 10));
  ASSERT_TRUE(rig.until([&] { return rig.told_of("the primary host \"scada\" is online") == 1; }));
}

}  // namespace berth::fleet::test
