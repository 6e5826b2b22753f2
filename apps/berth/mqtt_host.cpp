#include "mqtt_host.hpp"

#include <random>
#include <utility>

#include "options.hpp"

#if BERTH_MQTT
#include "berth/fleet/fleet.hpp"
#include "berth/mqtt/where.hpp"
#endif

namespace berth::cli {

bool mqtt_wanted(const design::Machine& machine, const Options& options) {
  return !options.offers.mqtt.empty() || (machine.mqtt && !options.offers.no_mqtt);
}

#if BERTH_MQTT

std::optional<Failure> mqtt_refused(const Options& options) {
  if (options.offers.mqtt.empty()) return std::nullopt;
  const auto where = mqtt::parse_where(options.offers.mqtt);
  if (where) return std::nullopt;
  return failure(Exit::usage, "--mqtt: " + where.error());
}

class MqttHost::Impl {
 public:
  explicit Impl(MachineRun& run) : run_(&run) {}
  ~Impl() { run_->record().also_on_frame({}); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  tl::expected<void, Failure> start(const Options& options, Carry carry) {
    std::random_device seed;
    auto made = fleet::Fleet::start(
        run_->session(), std::move(carry), clock_, Random(std::uint64_t{seed()} << 32U | seed()),
        {.broker = options.offers.mqtt, .backlog_file = beside_slot_table(*run_, ".mqtt"), .version = BERTH_VERSION});
    if (!made) return tl::unexpected(failure(Exit::usage, made.error()));
    fleet_ = std::move(*made);
    run_->record().also_on_frame(
        [this](const std::string& bus, const can::Frame& frame, rt::Time at, bool) { fleet_->frame(bus, frame, at); });
    return {};
  }
  [[nodiscard]] fleet::Fleet& fleet() noexcept { return *fleet_; }

 private:
  MachineRun* run_;
  fleet::SystemClock clock_;
  std::unique_ptr<fleet::Fleet> fleet_;
};

tl::expected<std::unique_ptr<MqttHost>, Failure> MqttHost::start(MachineRun& run, const Options& options, Carry carry) {
  auto impl = std::make_unique<Impl>(run);
  if (auto begun = impl->start(options, std::move(carry)); !begun) return tl::unexpected(begun.error());
  return std::unique_ptr<MqttHost>(new MqttHost(std::move(impl)));
}

std::string MqttHost::line() const { return "MQTT: " + impl_->fleet().where(); }
void MqttHost::event() noexcept { impl_->fleet().event(); }

#else

std::optional<Failure> mqtt_refused(const Options& options) {
  if (options.offers.mqtt.empty()) return std::nullopt;
  return failure(Exit::usage, "--mqtt: this berth was built without it (BERTH_MQTT=OFF)");
}

class MqttHost::Impl {};

tl::expected<std::unique_ptr<MqttHost>, Failure> MqttHost::start(MachineRun&, const Options&, Carry) {
  return tl::unexpected(
      failure(Exit::usage,
              "the machine file has [mqtt], and this berth was built without MQTT (BERTH_MQTT=OFF): give --no-mqtt"));
}

std::string MqttHost::line() const { return {}; }
void MqttHost::event() noexcept {}

#endif

MqttHost::MqttHost(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MqttHost::~MqttHost() = default;

}  // namespace berth::cli
