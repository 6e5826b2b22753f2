// What the MQTT connections of an edge node and of a host say of themselves (Sparkplug 3.0), read by a server that is
// no broker.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "berth/fleet/edge.hpp"
#include "berth/fleet/watch.hpp"
#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/state.hpp"
#include "tests/mqtt/heard.hpp"
#include "tests/mqtt/raw_broker.hpp"

namespace berth::fleet {
namespace {

using mqtt::Version;
using mqtt::test::Packet;
using mqtt::test::RawBroker;
using std::string_view_literals::operator""sv;

/// A CONNECT (MQTT 3.1.1 and 5.0 §3.1), as far as these tests ask.
struct Connect {
  bool clean = false;
  bool has_will = false;
  bool will_retained = false;
  unsigned will_qos = 0;
  std::string properties{};  // MQTT 5
  std::string client{};
  std::string will_topic{};
  std::string will{};
};

Connect read(const std::string& body, Version version) {
  std::size_t at = 0;
  const auto byte = [&] { return static_cast<unsigned char>(body.at(at++)); };
  const auto bytes = [&](std::size_t count) {
    at += count;
    return body.substr(at - count, count);
  };
  const auto text = [&] {
    const std::size_t high = byte();
    return bytes(high << 8U | byte());
  };
  Connect said;
  EXPECT_EQ(text(), "MQTT");
  EXPECT_EQ(byte(), version == Version::v5 ? 5 : 4);
  const unsigned flags = byte();
  said.clean = (flags & 2U) != 0;
  said.has_will = (flags & 4U) != 0;
  said.will_qos = flags >> 3U & 3U;
  said.will_retained = (flags & 32U) != 0;
  static_cast<void>(bytes(2));  // keep alive
  if (version == Version::v5) said.properties = bytes(byte());
  said.client = text();
  if (!said.has_will) return said;
  if (version == Version::v5) static_cast<void>(bytes(byte()));
  said.will_topic = text();
  said.will = text();
  return said;
}

std::string_view connack(Version version) {
  return version == Version::v5 ? mqtt::test::connack_5 : mqtt::test::connack_3;
}
/// All that was asked for is granted.
std::string suback(const Packet& asked, Version version, std::size_t filters) {
  const std::string_view none = version == Version::v5 ? "\0"sv : ""sv;
  std::string body = asked.body.substr(0, 2) + std::string(none) + std::string(filters, '\x01');
  return "\x90" + std::string(1, static_cast<char>(body.size())) + body;
}
/// 11h: Session Expiry Interval. Absent is 0: the session ends with the connection.
bool has_expiry(const Connect& said) { return said.properties.find('\x11') != std::string::npos; }

/// An edge node, or a host, at a server of the test.
class Conformance : public ::testing::TestWithParam<Version> {
 protected:
  void begin_edge() {
    EdgeOptions options;
    options.id = {"hall", "press"};
    options.connection = mqtt::test::quick(broker.where(), "press", GetParam());
    auto made = Edge::start(*thread, std::move(options), link, clock, Random(1));
    ASSERT_TRUE(made) << made.error();
    edge = std::move(*made);
  }
  void begin_host() {
    WatchOptions options;
    options.host = "scada";
    options.connection = mqtt::test::quick(broker.where(), "scada", GetParam());
    auto made = Watch::start(*thread, std::move(options), clock, Random(1));
    ASSERT_TRUE(made) << made.error();
    host = std::move(*made);
  }
  [[nodiscard]] Connect connect(const mqtt::test::Socket& client) const {
    const auto packet = client.packet();
    EXPECT_TRUE(packet && packet->kind() == mqtt::test::connect_packet);
    return packet ? read(packet->body, GetParam()) : Connect{};
  }
  /// The node is known, so that it is born once it is connected.
  void introduce() {
    News news{.kind = News::Kind::node};
    news.metrics.push_back({.name = "Machine/Operational", .type = sparkplug::DataType::boolean, .value = true});
    ASSERT_TRUE(link.news.put(news));
    edge->wake();
  }

  RawBroker broker;
  SystemClock clock;
  Link link;
  std::unique_ptr<Thread> thread = std::move(*Thread::start());
  std::unique_ptr<Edge> edge;
  std::unique_ptr<Watch> host;
};

}  // namespace

TEST_P(Conformance, SP_11_SP_12_SP_92_SP_270_AnEdgeNodeConnectsClean_WithNdeathAsItsWill) {
  begin_edge();
  const auto client = broker.accept();
  const auto said = connect(client);
  EXPECT_TRUE(said.clean);
  EXPECT_FALSE(has_expiry(said));
  ASSERT_TRUE(said.has_will);
  EXPECT_EQ(said.will_topic, "spBv1.0/hall/NDEATH/press");
  EXPECT_EQ(said.will_qos, 1U);
  EXPECT_FALSE(said.will_retained);
  const std::vector<std::uint8_t> bytes(said.will.begin(), said.will.end());
  const auto payload = sparkplug::decode(bytes);
  ASSERT_TRUE(payload);
  ASSERT_EQ(payload->metrics.size(), 1U);
  EXPECT_EQ(payload->metrics.front().name, "bdSeq");
}

TEST_P(Conformance, SP_76_SP_83_SP_84_SP_139_SP_281_AHostConnectsClean_WithStateOfflineAsItsWill) {
  begin_host();
  const auto client = broker.accept();
  const auto said = connect(client);
  EXPECT_TRUE(said.clean);
  EXPECT_FALSE(has_expiry(said));
  ASSERT_TRUE(said.has_will);
  EXPECT_EQ(said.will_topic, "spBv1.0/STATE/scada");
  EXPECT_EQ(said.will_qos, 1U);
  EXPECT_TRUE(said.will_retained);
  const std::vector<std::uint8_t> bytes(said.will.begin(), said.will.end());
  const auto state = sparkplug::decode_state(bytes);
  ASSERT_TRUE(state);
  EXPECT_FALSE(state->online);
}

// By MQTT 3.1.1 DISCONNECT has no reason: NDEATH comes before it (SP.275).
TEST_P(Conformance, SP_276_AnEdgeNodeThatEndsDisconnectsWithItsWill) {
  begin_edge();
  const auto client = broker.accept();
  static_cast<void>(connect(client));
  ASSERT_TRUE(client.say(connack(GetParam())));
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  ASSERT_EQ(asked->kind(), mqtt::test::subscribe_packet);
  introduce();
  std::size_t filters = 0;  // each ends with its options, after its length and its text
  for (std::size_t at = GetParam() == Version::v5 ? 3 : 2; at < asked->body.size(); ++filters) {
    const auto length =
        static_cast<unsigned char>(asked->body[at]) << 8U | static_cast<unsigned char>(asked->body[at + 1]);
    at += 2U + static_cast<std::size_t>(length) + 1U;
  }
  ASSERT_TRUE(client.say(suback(*asked, GetParam(), filters)));
  const auto birth = client.packet();
  ASSERT_TRUE(birth);
  EXPECT_NE(birth->body.find("spBv1.0/hall/NBIRTH/press"), std::string::npos);
  std::optional<Packet> last;
  bool died = false;
  std::thread ending([this] { edge.reset(); });  // it waits for the server's answers
  for (auto packet = client.packet(); packet; packet = client.packet()) {
    died = died || packet->body.find("spBv1.0/hall/NDEATH/press") != std::string::npos;
    last = packet;
    // QoS 1: its number follows the topic, and is acknowledged.
    if (packet->kind() == mqtt::test::publish_packet && (packet->type & 2U) != 0) {
      const auto length = static_cast<std::size_t>(static_cast<unsigned char>(packet->body[0])) << 8U |
                          static_cast<unsigned char>(packet->body[1]);
      EXPECT_TRUE(client.say("\x40\x02"sv) && client.say(packet->body.substr(2 + length, 2)));
    }
    if (packet->kind() == mqtt::test::disconnect_packet) break;
  }
  ending.join();
  EXPECT_TRUE(died);
  ASSERT_TRUE(last);
  ASSERT_EQ(last->kind(), mqtt::test::disconnect_packet);
  EXPECT_EQ(last->body.substr(0, 1), GetParam() == Version::v5 ? "\x04" : "");
}

INSTANTIATE_TEST_SUITE_P(Versions, Conformance, ::testing::Values(Version::v3_1_1, Version::v5),
                         [](const auto& version) { return version.param == Version::v5 ? "v5" : "v3_1_1"; });

}  // namespace berth::fleet
