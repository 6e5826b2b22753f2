#include "mqtt_host.hpp"

#include <charconv>
#include <utility>

#include "options.hpp"
#include "system_random.hpp"

#if BERTH_MQTT
#include "berth/fleet/fleet.hpp"
#include "berth/fleet/group_watch.hpp"
#include "berth/fleet/settings.hpp"
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

std::string mqtt_name(const design::Machine& machine, const Options& options) {
  if (!mqtt_wanted(machine, options)) return {};
  const auto settings = fleet::edge_options(machine, options.offers.mqtt, {});
  return settings ? settings->id.group + "/" + settings->id.node : std::string();
}

class MqttHost::Impl {
 public:
  explicit Impl(MachineRun& run) : run_(&run) {}
  ~Impl() { run_->record().also_on_frame({}); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  tl::expected<void, Failure> start(const Options& options, const std::string& studio, Carry carry) {
    auto random = system_random();
    auto made = fleet::Fleet::start(run_->session(), std::move(carry), clock_, random.fork(),
                                    {.broker = options.offers.mqtt,
                                     .backlog_file = beside_slot_table(*run_, ".mqtt"),
                                     .version = BERTH_VERSION,
                                     .studio = studio});
    if (!made) return tl::unexpected(failure(Exit::usage, made.error()));
    fleet_ = std::move(*made);
    if (auto settings = fleet::edge_options(run_->machine(), options.offers.mqtt, {}))
      group_.emplace(fleet::GroupWatch::Options{.connection = settings->connection, .id = settings->id}, random.fork());
    run_->record().also_on_frame(
        [this](const std::string& bus, const can::Frame& frame, rt::Time at, bool) { fleet_->frame(bus, frame, at); });
    return {};
  }
  [[nodiscard]] fleet::Fleet& fleet() noexcept { return *fleet_; }
  [[nodiscard]] std::optional<fleet::GroupWatch>& group() noexcept { return group_; }

 private:
  MachineRun* run_;
  fleet::SystemClock clock_;
  std::unique_ptr<fleet::Fleet> fleet_;
  std::optional<fleet::GroupWatch> group_;
};

tl::expected<std::unique_ptr<MqttHost>, Failure> MqttHost::start(MachineRun& run, const Options& options,
                                                                 const std::string& studio, Carry carry) {
  auto impl = std::make_unique<Impl>(run);
  if (auto begun = impl->start(options, studio, std::move(carry)); !begun) return tl::unexpected(begun.error());
  return std::unique_ptr<MqttHost>(new MqttHost(std::move(impl)));
}

std::string MqttHost::line() const { return "MQTT: " + impl_->fleet().where(); }
void MqttHost::event() noexcept { impl_->fleet().event(); }

command::Reply MqttHost::fleet(const command::Request& request) {
  std::uint64_t since = 0;
  for (const auto& [name, value] : request.arguments) {
    const char* const end = value.data() + value.size();
    const auto [last, error] = std::from_chars(value.data(), end, since);
    if (name != "since" || error != std::errc() || last != end)
      return command::refusal(Exit::usage, "\"fleet\" takes \"since\", the number \"changes\" of an earlier answer");
  }
  if (!impl_->group()) return command::refusal(Exit::failed, "the machine's broker is not known");
  command::Reply reply;
  reply.json = impl_->group()->answer(since);
  return reply;
}

#else

std::optional<Failure> mqtt_refused(const Options& options) {
  if (options.offers.mqtt.empty()) return std::nullopt;
  return failure(Exit::usage, "--mqtt: this berth was built without it (BERTH_MQTT=OFF)");
}

std::string mqtt_name(const design::Machine&, const Options&) { return {}; }

class MqttHost::Impl {};

tl::expected<std::unique_ptr<MqttHost>, Failure> MqttHost::start(MachineRun&, const Options&, const std::string&,
                                                                 Carry) {
  return tl::unexpected(
      failure(Exit::usage,
              "the machine file has [mqtt], and this berth was built without MQTT (BERTH_MQTT=OFF): give --no-mqtt"));
}

std::string MqttHost::line() const { return {}; }
void MqttHost::event() noexcept {}
command::Reply MqttHost::fleet(const command::Request&) {
  return command::refusal(Exit::no, "this berth was built without MQTT (BERTH_MQTT=OFF)");
}

#endif

MqttHost::MqttHost(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MqttHost::~MqttHost() = default;

}  // namespace berth::cli
