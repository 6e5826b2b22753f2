// A machine as an edge node: what it publishes in an hour, against a topic of JSON for each value, and what it costs
// the executor. No broker: the messages are counted where they would be sent.
#include <fmt/format.h>

#include <charconv>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/line.hpp"
#include "berth/sparkplug/edge_node.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr unsigned few = 20;
constexpr unsigned many = 120;  // one bus, nearly full

/// Counts what is sent, with MQTT's own bytes (fixed header, topic length; QoS 0).
class Counter final : public sparkplug::Outbox {
 public:
  struct Sum {
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
    Sum operator-(const Sum& other) const { return {messages - other.messages, bytes - other.bytes}; }
  };
  void publish(sparkplug::Publication message) override { add(message.topic.size() + message.bytes.size()); }
  void subscribe(const std::string&, std::uint8_t) override {}
  void probe(std::uint64_t mark) override {
    add(std::strlen("berth-probe/berth/line-3"));
    mark_ = mark;
  }
  void disconnect() override {}
  [[nodiscard]] const Sum& sum() const { return sum_; }
  /// Of one message, until now.
  [[nodiscard]] std::uint64_t largest() const { return largest_; }
  [[nodiscard]] std::uint64_t take_mark() { return std::exchange(mark_, 0); }

 private:
  void add(std::size_t content) {
    const std::uint64_t rest = content + 2;
    const std::uint64_t bytes = rest + (rest < 128 ? 2 : rest < 16'384 ? 3 : 4);
    ++sum_.messages;
    sum_.bytes += bytes;
    largest_ = std::max(largest_, bytes);
  }
  Sum sum_;
  std::uint64_t largest_ = 0;
  std::uint64_t mark_ = 0;
};

/// The same values as one topic of JSON each.
struct Naive {
  Counter::Sum sum;
  std::map<std::string, std::uint64_t> newest;  ///< bytes of each topic's last message
  void add(const std::string& device, const std::string& metric, const std::string& value) {
    const auto topic = fmt::format("berth/line-3/{}/{}", device, metric);
    const auto json = fmt::format(R"({{"value":{},"timestamp":1767225600000}})", value);
    ++sum.messages;
    sum.bytes += topic.size() + json.size() + 4;
    newest[topic] = topic.size() + json.size() + 4;
  }
  /// Each value once a second, changed or not.
  [[nodiscard]] Counter::Sum in_an_hour() const {
    Counter::Sum all;
    for (const auto& [topic, bytes] : newest) all.messages += 3600, all.bytes += 3600 * bytes;
    return all;
  }
};

/// A line as an edge node.
class Machine : public sparkplug::Application {
 public:
  explicit Machine(unsigned slots) : line_(slots) {
    sparkplug::EdgeNodeOptions options;
    options.id = {"berth", "line-3"};
    node_ = std::make_unique<sparkplug::EdgeNode>(std::move(options), counter_, *this, backlog_);
    static_cast<void>(node_->connecting(line_.clock().now()));
    node_->connected(line_.clock().now());
  }

  bench::Line& line() { return line_; }
  /// `each`: called once in a step of 100 ms.
  template <class Each>
  void run(rt::Duration time, Each each) {
    for (rt::Duration passed{0}; passed < time; passed += 100ms) {
      each();
      line_.run(100ms);
      turn();
    }
  }
  void ask_rebirth() { node_->ask_rebirth(line_.clock().now()); }
  [[nodiscard]] Counter& counter() { return counter_; }
  [[nodiscard]] const Naive& naive() const { return naive_; }

 private:
  void command(const sparkplug::Command&) override {}
  void refused(const std::string&, const std::string&, const std::string&) override {}

  static std::string text_of(const sparkplug::Value& value) {
    if (const auto* text = std::get_if<std::string>(&value)) return '"' + *text + '"';
    if (const auto* whole = std::get_if<std::uint64_t>(&value)) return fmt::format("{}", *whole);
    if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
    if (const auto* real = std::get_if<float>(&value)) return fmt::format("{}", *real);
    return "null";
  }

  // As the edge does.
  void turn() {
    const auto now = line_.clock().now();
    while (auto news = line_.take()) {
      for (const auto& metric : news->metrics) naive_.add(news->device, metric.name, text_of(metric.value));
      switch (news->kind) {
        case fleet::News::Kind::node: static_cast<void>(node_->set_metrics(std::move(news->metrics), now)); break;
        case fleet::News::Kind::born:
          static_cast<void>(node_->device_born(news->device, std::move(news->metrics), now));
          break;
        case fleet::News::Kind::died: node_->device_died(news->device, now); break;
        case fleet::News::Kind::change:
          naive_.add(news->device, news->metric, text_of(news->value));
          static_cast<void>(node_->change(news->device, news->metric, news->value, news->at, news->quality));
          break;
      }
    }
    node_->tick(now);
    if (const auto mark = counter_.take_mark(); mark != 0) node_->answered(mark);
  }

  bench::Line line_;
  Counter counter_;
  Naive naive_;
  sparkplug::MemoryBacklog backlog_;
  std::unique_ptr<sparkplug::EdgeNode> node_;
};

// ---- what the executor does for it

/// `count` frames, every fourth a PDO with a chosen value.
void frames(unsigned count) {
  std::vector<fleet::Signal> signals;
  for (unsigned i = 1; i <= few; ++i) {
    fleet::Signal signal;
    signal.type = od::DataType::unsigned32;
    signal.key = 0x180 + i;
    signal.bits = 32;
    signals.push_back(std::move(signal));
  }
  fleet::SignalTable table(signals, 1);
  for (unsigned i = 0; i < count; ++i) {
    const std::uint32_t id = i % 4 == 0 ? 0x180 + i / 4 % few + 1 : 0x700 + i % few + 1;
    const auto byte = static_cast<std::uint8_t>(i);
    table.frame(0, can::Frame::base(id, {byte, 0, 0, 0}), rt::Time(rt::Duration(i)));
  }
}

void looks(unsigned count) {
  Machine machine(few);
  machine.run(20s, [] {});
  for (unsigned i = 0; i < count; ++i) machine.line().reporter().look_now();
}

// With the making of the frame.
constexpr bench::Counted of_a_frame{"instructions for a frame (a quarter of them PDOs with a value)", "--frames",
                                    100'000, 100, 120};
constexpr bench::Counted of_a_look{"instructions for a look ten times a second, 20 devices, nothing changed", "--looks",
                                   10'000, 6'000, 8'000};

std::string row(const Counter::Sum& sum) { return fmt::format("{} messages, {} bytes", sum.messages, sum.bytes); }

void compare(std::vector<bench::Figure>& figures, const std::string& what, const Counter::Sum& berth,
             const Counter::Sum& json) {
  figures.push_back({fmt::format("{}: Sparkplug", what), row(berth)});
  figures.push_back({fmt::format("{}: a topic of JSON for each value, on change", what), row(json)});
}

/// What a machine publishes; empty: it did not become operational.
std::vector<bench::Figure> published(unsigned slots) {
  std::vector<bench::Figure> figures;
  Machine machine(slots);
  Counter& counter = machine.counter();
  machine.run(30s, [] {});
  if (!machine.line().operational()) return {};
  compare(figures, "start", counter.sum(), machine.naive().sum);
  auto before = counter.sum();
  auto before_naive = machine.naive().sum;
  machine.ask_rebirth();
  machine.run(5s, [] {});
  figures.push_back({"all births once more, as after a lost connection", row(counter.sum() - before)});
  figures.push_back({"its largest message (NBIRTH)", fmt::format("{} bytes", counter.largest())});
  before = counter.sum();
  const auto frames_before = machine.line().frames();
  machine.run(1h, [] {});
  compare(figures, "an idle hour", counter.sum() - before, machine.naive().sum - before_naive);
  figures.push_back({"an idle hour: a topic of JSON for each value, every second", row(machine.naive().in_an_hour())});
  figures.push_back({"an idle hour: PINGREQ and PINGRESP of both (keep-alive 30 s)", row({240, 480})});
  figures.push_back(
      {"frames on the bus meanwhile", bench::grouped(static_cast<double>(machine.line().frames() - frames_before))});
  std::uint32_t value = 0;
  for (const auto& [pace, steps] : {std::pair{"ten times a second", 1U}, std::pair{"every 10 s", 100U}}) {
    before = counter.sum();
    before_naive = machine.naive().sum;
    unsigned step = 0;
    machine.run(6min, [&] {
      if (step++ % steps == 0) machine.line().set_positions(++value);
    });
    compare(figures, fmt::format("six minutes, {} values that change {}", slots, pace), counter.sum() - before,
            machine.naive().sum - before_naive);
  }
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3) {  // under callgrind
    unsigned count = 0;
    std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), count);
    if (std::strcmp(argv[1], "--frames") == 0) frames(count);
    if (std::strcmp(argv[1], "--looks") == 0) looks(count);
    return 0;
  }
  for (const unsigned slots : {few, many}) {
    auto figures = published(slots);
    if (figures.empty()) return 1;
    if (slots == few) {
      figures.push_back(bench::count(of_a_frame));
      figures.push_back(bench::count(of_a_look));
    }
    bench::print_figures(
        fmt::format("a machine of {} slots as an edge node, MQTT's bytes included, TCP's and TLS's not", slots),
        figures);
  }
  return 0;
}
