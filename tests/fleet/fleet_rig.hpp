/// A machine of two sensors on a simulated bus, as an edge node at Mosquitto, and a host that reads what it publishes.
/// The world is turned by this thread, in steps; the edge has its own threads.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/command/audit.hpp"
#include "berth/command/execute.hpp"
#include "berth/fleet/fleet.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/topic.hpp"
#include "berth/tree/session.hpp"
#include "tests/mqtt/heard.hpp"
#include "tests/paths.hpp"

namespace berth::fleet::test {

using namespace std::chrono_literals;
using mqtt::test::Broker;
using mqtt::test::Folder;
using sparkplug::MessageType;
using sparkplug::Payload;
using sparkplug::Value;

/// Its EDS: TPDO 1, on change, has 6004h; 2000h (rw), 2002h are in no PDO.
inline std::string machine_text(const std::string& mqtt, const std::string& publish, const std::string& name = "line") {
  const auto slot = [](int id, const std::string& slot_name, const std::string& more) {
    return fmt::format("[[slot]]\nbus = \"field\"\nid = {}\nname = \"{}\"\neds = \"eds/sensor.eds\"\n{}", id, slot_name,
                       more);
  };
  return fmt::format("[machine]\nname = \"{}\"\n{}[bus.field]\nport = \"sim\"\nbitrate = 250_000\n{}{}", name, mqtt,
                     slot(1, "left", publish), slot(2, "right", ""));
}
inline constexpr const char* plant_text =
    "[plant]\nseed = 3\n[bus.field]\n[[device]]\nbus = \"field\"\nname = \"a\"\neds = \"eds/sensor.eds\"\nserial = 1\n"
    "[[device]]\nbus = \"field\"\nname = \"b\"\neds = \"eds/sensor.eds\"\nserial = 2\n";

inline std::string in_examples(const std::string& file) { return berth::test::source_dir() + "/examples/" + file; }

inline design::Machine machine_of(const std::string& text) {
  auto read = design::read_machine(text, in_examples("fleet.toml"), design::eds_loader());
  for (const auto& each : read.findings) ADD_FAILURE() << to_string(each);
  return read.machine ? std::move(*read.machine) : design::Machine{};
}

/// UTC follows the world, which is turned quicker than the clock.
class RigClock final : public Clock {
 public:
  explicit RigClock(rt::Executor& executor) : executor_(&executor) {}
  [[nodiscard]] sparkplug::Now now() const noexcept override {
    if (std::this_thread::get_id() == owner_) {
      const auto since = std::chrono::duration_cast<std::chrono::milliseconds>(executor_->now().time_since_epoch());
      world_ms_ = since.count();
    }
    auto now = SystemClock().now();
    now.utc.ms = begin_ms + static_cast<std::uint64_t>(world_ms_.load());
    return now;
  }
  static constexpr std::uint64_t begin_ms = 1'767'225'600'000;  // 2026-01-01

 private:
  rt::Executor* executor_;
  std::thread::id owner_ = std::this_thread::get_id();
  mutable std::atomic<std::int64_t> world_ms_{0};
};

/// The machine, its world and Berth.
class Rig : private can::Tap {
 public:
  explicit Rig(const std::string& text) : machine_(machine_of(text)) {
    const auto plant = plant::read_plant(plant_text, in_examples("fleet.plant.toml"));
    for (const auto& each : plant.findings) ADD_FAILURE() << to_string(each);
    Findings findings;
    const std::vector<plant::BusRate> rates{{"field", 250'000}};
    world_ = plant::World::make(*plant.plant, rates, findings);
    for (const auto& each : findings) ADD_FAILURE() << to_string(each);
    port_ = world_->attach_master("field");
    world_->start();
    clock_.emplace(world_->executor());
    session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
    EXPECT_TRUE(session_->connect("field", *port_));
    EXPECT_TRUE(session_->open());
    session_->on_event([this](const operate::Event& event) {
      lines.push_back(event.text);
      if (fleet) fleet->event();
    });
    world_->bus("field")->add_tap(*this);
    session_->start();
  }
  ~Rig() {
    fleet.reset();
    world_->bus("field")->remove_tap(*this);
    session_.reset();
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  /// Begins to publish; empty: it did. `careful`: as if the buses were real.
  std::string publish(const Options& options) {
    const auto carry = [this](const command::Request& request, command::Reply& reply) {
      requests.push_back(request);
      return command::execute(*session_, request, reply);
    };
    auto made = Fleet::start(*session_, carry, *clock_, Random(5), options);
    if (!made) return made.error();
    fleet = std::move(*made);
    return {};
  }

  /// Turns the world until it is so; real time passes meanwhile, a tenth of the world's.
  [[nodiscard]] testing::AssertionResult until(const std::function<bool()>& so) {
    const auto end = std::chrono::steady_clock::now() + mqtt::test::patience;
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return testing::AssertionFailure() << "it did not come\n" << told();
      run(20ms);
      std::this_thread::sleep_for(2ms);
    }
    return testing::AssertionSuccess();
  }
  void run(rt::Duration time) { world_->sim().run_for(time); }
  [[nodiscard]] testing::AssertionResult up() {
    return until([this] { return session_->operational(); });
  }
  /// As its encoder would: the TPDO is sent.
  void set_position(const std::string& device, std::uint32_t value) {
    auto& firmware = world_->find(device)->device();
    const ObjectRef position{0x6004, 0};
    std::vector<std::uint8_t> bytes;
    for (unsigned i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    EXPECT_EQ(firmware.values().set_bytes(position, bytes), od::AbortCode::none);
    firmware.services().changed(position);
  }
  std::uint64_t value_in(const std::string& device, ObjectRef object) {
    std::uint64_t value = 0;
    const auto bytes = world_->find(device)->device().values().bytes(object);
    for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8U | bytes[i];
    return value;
  }
  [[nodiscard]] operate::SlotReport slot(const std::string& name) const {
    const auto slots = session_->slots();
    const auto it = std::ranges::find(slots, name, &operate::SlotReport::name);
    return it == slots.end() ? operate::SlotReport{} : *it;
  }
  /// The device in this slot.
  plant::SimDevice& device_in(const std::string& name) {
    const auto serial = slot(name).device->address.serial;
    return *world_->find(serial == 1 ? "a" : "b");
  }
  [[nodiscard]] std::string told() const {
    std::string all;
    for (const auto& line : lines) all += line + "\n";
    return all;
  }
  [[nodiscard]] std::size_t told_of(const std::string& part) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(lines, [&](const std::string& line) { return line.find(part) != std::string::npos; }));
  }
  /// Answers in the audit log, of lines that have this part.
  std::vector<std::string> audited(const std::string& part) {
    std::vector<std::string> found;
    const auto history = store_.history(std::nullopt);
    for (const auto& line : history.value()) {
      if (line.event == command::audit_event && line.reason.find(part) != std::string::npos)
        found.push_back(line.reason);
    }
    return found;
  }
  tree::Session& session() { return *session_; }
  plant::World& world() { return *world_; }

  std::vector<std::string> lines;
  std::vector<command::Request> requests;
  std::unique_ptr<Fleet> fleet;

 private:
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    if (fleet) fleet->frame(std::size_t{0}, frame, at);
  }
  void error(const can::BusError&, rt::Time) noexcept override {}

  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::optional<RigClock> clock_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<tree::Session> session_;
};

/// What one node has published, message by message, as any host sees it.
class View {
 public:
  explicit View(const Broker& broker, const std::string& client = "view")
      : station_(subscribing(mqtt::test::quick(broker.where(), client))) {
    EXPECT_TRUE(station_.heard.until(mqtt::test::is_up));
  }

  struct Said {
    MessageType type;
    std::string device;
    Payload payload;
    std::string bytes;
  };
  /// One value of one metric, in the order of coming.
  struct Change {
    std::string device;
    std::string metric;
    Value value;
    std::uint64_t at = 0;
    bool historical = false;
    sparkplug::Quality quality = sparkplug::Quality::good;
    bool birth = false;
  };

  void look() {
    const auto story = station_.heard.story();
    for (; seen_ < story.messages.size(); ++seen_) take(story.messages[seen_]);
  }
  [[nodiscard]] std::size_t count(MessageType type, const std::string& device = {}) {
    look();
    return static_cast<std::size_t>(
        std::ranges::count_if(said, [&](const Said& s) { return s.type == type && s.device == device; }));
  }
  /// Null: none came.
  [[nodiscard]] const Change* last(const std::string& device, const std::string& metric) {
    look();
    const auto it = std::find_if(changes.rbegin(), changes.rend(), [&](const Change& c) {
      return c.device == device && c.metric == metric && !c.historical;
    });
    return it == changes.rend() ? nullptr : &*it;
  }
  [[nodiscard]] bool is(const std::string& device, const std::string& metric, const Value& value) {
    const auto* const change = last(device, metric);
    return change != nullptr && sparkplug::same(change->value, value);
  }
  /// A cell of the row in "Commands/Refused" or "Commands/Done".
  [[nodiscard]] std::string cell(const std::string& metric, std::size_t column) {
    const auto* const change = last("", metric);
    if (change == nullptr) return {};
    const auto* const set = std::get_if<sparkplug::Boxed<sparkplug::DataSet>>(&change->value);
    if (set == nullptr) return {};
    const auto* const text = std::get_if<std::string>(&(*set)->rows.at(0).at(column));
    return text == nullptr ? std::string() : *text;
  }
  void command(const std::string& device, const std::string& metric, sparkplug::DataType type, Value value,
               const std::string& node = "line") {
    sparkplug::Metric written;
    written.name = metric;
    written.type = type;
    written.value = std::move(value);
    Payload payload;
    payload.metrics.push_back(std::move(written));
    const auto bytes = sparkplug::encode(payload);
    const auto topic = device.empty() ? sparkplug::make_topic({"berth", node}, MessageType::ncmd)
                                      : sparkplug::make_topic({"berth", node}, MessageType::dcmd, device);
    static_cast<void>(station_.publish(topic, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  }
  mqtt::test::Station& station() { return station_; }

  std::vector<Said> said;
  std::vector<Change> changes;

 private:
  static mqtt::Options subscribing(mqtt::Options options) {
    options.subscriptions = {"spBv1.0/#"};
    return options;
  }
  void take(const mqtt::test::Arrived& message) {
    const auto topic = sparkplug::parse_topic(message.topic);
    if (!topic || topic->type == MessageType::ncmd || topic->type == MessageType::dcmd ||
        topic->type == MessageType::state)
      return;
    const std::vector<std::uint8_t> bytes(message.payload.begin(), message.payload.end());
    const auto payload = sparkplug::decode(bytes);
    ASSERT_TRUE(payload) << message.topic;
    said.push_back({topic->type, topic->device, *payload, message.payload});
    const bool birth = topic->type == MessageType::nbirth || topic->type == MessageType::dbirth;
    for (const auto& metric : payload->metrics) take(*topic, metric, birth);
  }
  void take(const sparkplug::Topic& topic, const sparkplug::Metric& metric, bool birth) {
    if (birth && metric.alias) names_[*metric.alias] = {*metric.name, *metric.type};
    std::string name = metric.name.value_or("");
    auto type = metric.type.value_or(sparkplug::DataType::unknown);
    if (name.empty() && metric.alias) std::tie(name, type) = names_[*metric.alias];
    const auto value = type == sparkplug::DataType::unknown ? metric.value : sparkplug::interpret(type, metric.value);
    changes.push_back({topic.device, name, value, metric.at ? metric.at->ms : 0, metric.historical,
                       sparkplug::quality(metric).value_or(sparkplug::Quality::bad), birth});
  }

  mqtt::test::Station station_;
  std::size_t seen_ = 0;
  std::map<std::uint64_t, std::pair<std::string, sparkplug::DataType>> names_;
};

inline Options to(const Broker& broker, const std::string& file = {}) {
  return {.broker = mqtt::to_string(broker.where()), .backlog_file = file, .version = "test"};
}

}  // namespace berth::fleet::test
