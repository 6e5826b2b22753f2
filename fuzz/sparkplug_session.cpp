// An edge node and a host that hear any messages, at any time, on any of their topics. The node publishes nothing
// before its birth, and numbers without a gap; the host keeps within its limits. Input: commands of one byte, each with
// what it needs; a message has its topic's number, its length and its bytes.
#include <cstdint>
#include <string>

#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/edge_node.hpp"
#include "berth/sparkplug/host.hpp"
#include "fuzz/require.hpp"

namespace sparkplug_session_target {

namespace {

using namespace berth;
using namespace berth::sparkplug;
using fuzz::require;

class Out final : public Outbox {
 public:
  void publish(Publication message) override {
    const auto topic = parse_topic(message.topic);
    const auto payload = topic && topic->type != MessageType::state ? decode(message.bytes) : Payload{};
    require(topic.has_value() && payload.has_value());
    last = message;
    if (topic->type == MessageType::state || topic->type == MessageType::ncmd || topic->type == MessageType::dcmd)
      return;
    if (topic->type == MessageType::ndeath) {
      require(born);
      born = false;
      return;
    }
    if (topic->type == MessageType::nbirth) {
      born = true;
      seq = 0;
    }
    require(born && payload->seq == std::uint64_t{seq++});
  }
  void subscribe(const std::string&, std::uint8_t) override {}
  void probe(std::uint64_t to) override { mark = to; }
  void disconnect() override {}
  Publication last;
  bool born = false;
  std::uint8_t seq = 0;
  std::uint64_t mark = 0;
};

class Ears final : public Application, public HostEvents {
 public:
  void command(const Command& command) override {
    require(command.metric == "target" && std::holds_alternative<std::int64_t>(command.value));
  }
  void refused(const std::string&, const std::string&, const std::string& reason) override { require(!reason.empty()); }
  void born(const EdgeNodeId&, const std::string&) override {}
  void died(const EdgeNodeId&, const std::string&) override {}
  void value(const EdgeNodeId&, const std::string&, const std::string&, const Metric&) override {}
  void trouble(const EdgeNodeId&, const char* why) override { require(*why != '\0'); }
};

class Input {
 public:
  explicit Input(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  [[nodiscard]] bool more() const { return !bytes_.empty(); }
  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const auto out = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return out;
  }
  std::span<const std::uint8_t> some() {
    const std::size_t wanted = byte();
    const auto size = std::min(wanted, bytes_.size());
    const auto out = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return out;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

const char* const topics[] = {"spBv1.0/G/NCMD/E",     "spBv1.0/G/DCMD/E/a",  "spBv1.0/STATE/h",
                              "spBv1.0/G/NBIRTH/F",   "spBv1.0/G/NDEATH/F",  "spBv1.0/G/NDATA/F",
                              "spBv1.0/G/DBIRTH/F/a", "spBv1.0/G/DDATA/F/a", "spBv1.0/G/DDEATH/F/a",
                              "spBv1.0/G/DDATA/F/b",  "spBv1.0/STATE/s",     "spBv1.0/G/NBIRTH/X"};

std::vector<OwnMetric> metrics(std::int64_t now) {
  return {{.name = "x", .type = DataType::int8, .value = now},
          {.name = "target", .type = DataType::int32, .value = std::int64_t{0}, .writable = true}};
}

EdgeNodeOptions node_options(std::uint8_t how) {
  EdgeNodeOptions out;
  out.id = {"G", "E"};
  if ((how & 1) != 0) out.primary_host = "h";
  out.aliases = (how & 2) == 0;
  out.several_servers = (how & 4) != 0;
  out.most_unproven = 4;
  out.most_pending = 4;
  return out;
}
HostOptions host_options(std::uint8_t how) {
  HostOptions out;
  out.id = "s";
  out.limits = {.nodes = 2, .devices = 2, .metrics = 8, .value_bytes = 64, .bytes = 20'000};
  out.most_held = 4;
  if ((how & 8) != 0) out.reorder_timeout = std::chrono::milliseconds(0);
  return out;
}

class Pair {
 public:
  explicit Pair(std::uint8_t how)
      : node_(node_options(how), node_out_, ears_, backlog_), host_(host_options(how), host_out_, ears_) {}

  void act(Input& input) {
    const auto what = input.byte();
    now_.steady += std::chrono::milliseconds(what & 0xF0);
    now_.utc.ms += what & 0xF0U;
    switch (what & 0x0F) {
      case 0:
        (void)node_.connecting(now_);
        node_out_.born = false;
        return;
      case 1: return node_.connected(now_);
      case 2:
        node_.disconnected(now_);
        node_out_.born = false;
        return;
      case 3: (void)host_.connecting(now_); return;
      case 4: return host_.connected(now_);
      case 5: return host_.disconnected(now_);
      case 6: (void)node_.device_born(input.byte() % 2 == 0 ? "a" : "b", metrics(1), now_); return;
      case 7: return node_.device_died(input.byte() % 2 == 0 ? "a" : "b", now_);
      case 8:
        (void)node_.change(input.byte() % 2 == 0 ? "a" : "b", "x", std::int64_t{static_cast<std::int8_t>(input.byte())},
                           now_.utc);
        return;
      case 9: return node_.answered(node_out_.mark);
      case 10: (void)host_.write({"G", "F"}, "a", "target", std::int64_t{1}, now_); return;
      case 11: (void)node_.set_metrics(metrics(2), now_); return;
      case 12: return host_.message({node_out_.last.topic, node_out_.last.bytes, false}, now_);
      default: return hear(input);
    }
  }
  void tick() {
    node_.tick(now_);
    host_.tick(now_);
    (void)node_.next(now_);
    (void)host_.next();
    require(host_.fleet().nodes().size() <= 2 && host_.fleet().bytes() <= 40'000);
  }

 private:
  void hear(Input& input) {
    const auto* topic = topics[input.byte() % std::size(topics)];
    const auto bytes = input.some();
    node_.message({topic, bytes, (bytes.size() & 1) != 0}, now_);
    host_.message({topic, bytes, false}, now_);
  }
  Out node_out_, host_out_;
  Ears ears_;
  MemoryBacklog backlog_{{.entries = 16, .bytes = 4096}};
  EdgeNode node_;
  Host host_;
  Now now_{Utc{1000}, std::chrono::milliseconds(1000)};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(std::span(data, size));
  Pair pair(input.byte());
  while (input.more()) {
    pair.act(input);
    pair.tick();
  }
  return 0;
}

}  // namespace sparkplug_session_target
