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
#include "berth/fleet/reporter.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/sparkplug/edge_node.hpp"
#include "berth/tree/session.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr unsigned slots = 20;

std::string machine_text() {
  return fmt::format(
      "[machine]\nname = \"line-3\"\n[bus.field]\nport = \"sim\"\nbitrate = 500_000\n[[slot]]\nbus = \"field\"\n"
      "ids = \"1..{}\"\nname = \"sensor {{id}}\"\neds = \"eds/sensor.eds\"\npublish = [\"Position value\"]\n",
      slots);
}

std::string plant_text() {
  std::string serials;
  for (unsigned i = 1; i <= slots; ++i) serials += fmt::format("{}{}", i == 1 ? "" : ", ", i);
  return fmt::format(
      "[plant]\nseed = 3\n[bus.field]\n[[device]]\nbus = \"field\"\nname = \"s{{n}}\"\neds = \"eds/sensor.eds\"\n"
      "serials = [{}]\n",
      serials);
}

/// The executor's time, as if the world had begun in 2026.
class WorldClock final : public fleet::Clock {
 public:
  explicit WorldClock(rt::Executor& executor) : executor_(&executor) {}
  [[nodiscard]] sparkplug::Now now() const noexcept override {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(executor_->now().time_since_epoch());
    return {.utc = {1'767'225'600'000 + static_cast<std::uint64_t>(ms.count())}, .steady = ms};
  }

 private:
  rt::Executor* executor_;
};

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
  [[nodiscard]] std::uint64_t take_mark() { return std::exchange(mark_, 0); }

 private:
  void add(std::size_t content) {
    ++sum_.messages;
    sum_.bytes += content + 2 + (content + 2 < 128 ? 2 : 3);
  }
  Sum sum_;
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

class Line : public sparkplug::Application, private can::Tap {
 public:
  Line() {
    const std::string folder = std::string(BERTH_SOURCE_DIR) + "/examples/";
    auto machine = design::read_machine(machine_text(), folder + "fleet.toml", design::eds_loader());
    auto plant = plant::read_plant(plant_text(), folder + "fleet.plant.toml");
    if (!machine.machine || !plant.plant) std::abort();
    machine_ = std::move(*machine.machine);
    Findings findings;
    const std::vector<plant::BusRate> rates{{"field", 500'000}};
    world_ = plant::World::make(*plant.plant, rates, findings);
    port_ = world_->attach_master("field");
    world_->start();
    session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
    if (!session_->connect("field", *port_) || !session_->open()) std::abort();
    clock_ = std::make_unique<WorldClock>(world_->executor());
    node_ = std::make_unique<sparkplug::EdgeNode>(sparkplug::EdgeNodeOptions{.id = {"berth", "line-3"}}, counter_,
                                                  *this, backlog_);
    signals_ = fleet::plan_signals(machine_, nullptr).signals;
    table_ = std::make_unique<fleet::SignalTable>(signals_, 1);
    reporter_ = std::make_unique<fleet::Reporter>(*session_, signals_, *table_, link_, *clock_,
                                                  fleet::Reporter::Options{.version = "bench"}, [] {});
    session_->on_event([this](const operate::Event&) { reporter_->event(); });
    world_->bus("field")->add_tap(*this);
    session_->start();
    static_cast<void>(node_->connecting(clock_->now()));
    node_->connected(clock_->now());
  }
  ~Line() {
    world_->bus("field")->remove_tap(*this);
    session_->on_event({});
    reporter_.reset();
    session_.reset();
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  [[nodiscard]] bool operational() const { return session_->operational(); }
  fleet::Reporter& reporter() { return *reporter_; }
  /// `each`: called once in a step of 100 ms.
  template <class Each>
  void run(rt::Duration time, Each each) {
    for (rt::Duration passed{0}; passed < time; passed += 100ms) {
      each();
      world_->sim().run_for(100ms);
      turn();
    }
  }
  void set_positions(std::uint32_t value) {
    for (unsigned i = 1; i <= slots; ++i) {
      auto& firmware = world_->find(fmt::format("s{}", i))->device();
      std::array<std::uint8_t, 4> bytes{};
      std::memcpy(bytes.data(), &value, sizeof value);
      static_cast<void>(firmware.values().set_bytes({0x6004, 0}, bytes));
      firmware.services().changed(ObjectRef{0x6004, 0});
    }
  }
  [[nodiscard]] const Counter::Sum& sum() const { return counter_.sum(); }
  [[nodiscard]] const Naive& naive() const { return naive_; }
  std::uint64_t frames = 0;

 private:
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    ++frames;
    table_->frame(0, frame, at);
  }
  void error(const can::BusError&, rt::Time) noexcept override {}
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
    const auto now = clock_->now();
    while (auto news = link_.news.take()) {
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

  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<tree::Session> session_;
  std::unique_ptr<WorldClock> clock_;
  Counter counter_;
  Naive naive_;
  sparkplug::MemoryBacklog backlog_;
  std::unique_ptr<sparkplug::EdgeNode> node_;
  fleet::Link link_;
  std::vector<fleet::Signal> signals_;
  std::unique_ptr<fleet::SignalTable> table_;
  std::unique_ptr<fleet::Reporter> reporter_;
};

// ---- what the executor does for it

/// `count` frames, every fourth a PDO with a chosen value.
void frames(unsigned count) {
  std::vector<fleet::Signal> signals;
  for (unsigned i = 1; i <= slots; ++i) {
    fleet::Signal signal;
    signal.type = od::DataType::unsigned32;
    signal.key = 0x180 + i;
    signal.bits = 32;
    signals.push_back(std::move(signal));
  }
  fleet::SignalTable table(signals, 1);
  for (unsigned i = 0; i < count; ++i) {
    const std::uint32_t id = i % 4 == 0 ? 0x180 + i / 4 % slots + 1 : 0x700 + i % slots + 1;
    const auto byte = static_cast<std::uint8_t>(i);
    table.frame(0, can::Frame::base(id, {byte, 0, 0, 0}), rt::Time(rt::Duration(i)));
  }
}

void looks(unsigned count) {
  Line line;
  line.run(20s, [] {});
  for (unsigned i = 0; i < count; ++i) line.reporter().look_now();
}

// With the making of the frame.
constexpr bench::Counted of_a_frame{"instructions for a frame (a quarter of them PDOs with a value)", "--frames",
                                    100'000, 100, 120};
constexpr bench::Counted of_a_look{"instructions for a look ten times a second, 20 devices, nothing changed", "--looks",
                                   10'000, 6'000, 8'000};

std::string row(const Counter::Sum& sum) { return fmt::format("{} messages, {} bytes", sum.messages, sum.bytes); }

void compare(std::vector<bench::Figure>& figures, const char* what, const Counter::Sum& berth,
             const Counter::Sum& json) {
  figures.push_back({fmt::format("{}: Sparkplug", what), row(berth)});
  figures.push_back({fmt::format("{}: a topic of JSON for each value, on change", what), row(json)});
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
  std::vector<bench::Figure> figures;
  Line line;
  line.run(30s, [] {});
  if (!line.operational()) return 1;
  compare(figures, "start", line.sum(), line.naive().sum);
  auto before = line.sum();
  auto before_naive = line.naive().sum;
  const auto frames_before = line.frames;
  line.run(1h, [] {});
  compare(figures, "an idle hour", line.sum() - before, line.naive().sum - before_naive);
  figures.push_back({"an idle hour: a topic of JSON for each value, every second", row(line.naive().in_an_hour())});
  figures.push_back({"an idle hour: PINGREQ and PINGRESP of both (keep-alive 30 s)", row({240, 480})});
  figures.push_back({"frames on the bus meanwhile", bench::grouped(static_cast<double>(line.frames - frames_before))});
  before = line.sum();
  before_naive = line.naive().sum;
  std::uint32_t value = 0;
  line.run(6min, [&] { line.set_positions(++value); });
  compare(figures, "six minutes, 20 values that change ten times a second", line.sum() - before,
          line.naive().sum - before_naive);
  figures.push_back(bench::count(of_a_frame));
  figures.push_back(bench::count(of_a_look));
  bench::print_figures(
      fmt::format("a machine of {} slots as an edge node, MQTT's bytes included, TCP's and TLS's not", slots), figures);
  return 0;
}
