/// `berth up --mqtt`: the machine as an edge node at an MQTT broker during the main job (docs/fleet.md).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// What is wrong with `--mqtt`, checked first: no address, or this berth was built without MQTT.
[[nodiscard]] std::optional<Failure> mqtt_refused(const Options& options);
/// `--mqtt` or the machine file names a broker.
[[nodiscard]] bool mqtt_wanted(const design::Machine& machine, const Options& options);

/// The edge node of a machine run in real time.
class MqttHost {
 public:
  using Carry = std::function<rt::Task<void>(const command::Request& request, command::Reply& reply)>;
  /// The machine run must outlive it.
  [[nodiscard]] static tl::expected<std::unique_ptr<MqttHost>, Failure> start(MachineRun& run, const Options& options,
                                                                              Carry carry);
  /// Says goodbye to the broker: two seconds at most.
  ~MqttHost();
  MqttHost(const MqttHost&) = delete;
  MqttHost& operator=(const MqttHost&) = delete;
  /// "MQTT: mqtts://broker:8883, as berth/line-3".
  [[nodiscard]] std::string line() const;
  void event() noexcept;

 private:
  class Impl;
  explicit MqttHost(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::cli
