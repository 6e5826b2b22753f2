// Two edge nodes with one name, each with a client-ID of its own, so that the broker lets both be; and a host.
#include "berth/sparkplug/host.hpp"
#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

class Deaf final : public HostEvents {
 public:
  void born(const EdgeNodeId&, const std::string&) override {}
  void died(const EdgeNodeId&, const std::string&) override {}
  void value(const EdgeNodeId&, const std::string&, const std::string&, const Metric&) override {}
  void trouble(const EdgeNodeId&, const char*) override { ++troubles; }
  std::size_t troubles = 0;
};

/// A machine that changes all the time.
struct Twin {
  explicit Twin(const Now& now) : node(EdgeWorld::defaults(), wire, app, backlog) {
    EXPECT_TRUE(node.set_metrics({metric("speed", DataType::int32, std::int64_t{0})}, now));
    static_cast<void>(node.connecting(now));
    node.connected(now);
  }
  void turn(std::int64_t value, const Now& now) {
    EXPECT_TRUE(node.change("", "speed", value, now.utc));
    node.tick(now);
  }
  Wire wire;
  Listener app;
  MemoryBacklog backlog;
  EdgeNode node;
};

/// How often the host asks for a birth in two minutes, in which each machine changes ten times a second.
std::size_t requests_in_two_minutes(std::chrono::milliseconds reorder_timeout, Deaf& heard) {
  Now now{Utc{1'000'000}, 50'000ms};
  Wire wire;
  HostOptions options;
  options.id = "scada";
  options.reorder_timeout = reorder_timeout;
  Host host(options, wire, heard);
  static_cast<void>(host.connecting(now));
  host.connected(now);
  Twin one(now), other(now);
  std::size_t requests = 0;
  for (std::int64_t i = 1; i <= 1'200; ++i) {
    now.steady += 100ms;
    now.utc.ms += 100;
    for (Twin* const twin : {&one, &other}) {
      twin->turn(twin == &one ? i : -i, now);
      for (const auto& message : std::exchange(twin->wire.published, {}))
        host.message({message.topic, message.bytes, false}, now);
    }
    host.tick(now);
    for (const auto& message : std::exchange(wire.published, {})) {
      if (message.topic.find("/NCMD/") == std::string::npos) continue;
      ++requests;
      for (Twin* const twin : {&one, &other}) twin->node.message({message.topic, message.bytes, false}, now);
    }
  }
  return requests;
}

}  // namespace

// The host is never content, and cannot be: but it makes no storm.
TEST(SparkplugTwins, OneNameTwiceIsNoStormOfBirths) {
  for (const auto reorder_timeout : {2000ms, 0ms}) {
    Deaf heard;
    const auto requests = requests_in_two_minutes(reorder_timeout, heard);
    EXPECT_GT(heard.troubles, 20U) << "it is said";
    EXPECT_GT(requests, 10U);
    EXPECT_LT(requests, 2U * 120U) << "two births a second at most, one of each node";
  }
}

}  // namespace sparkplug_test
