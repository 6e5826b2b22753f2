/// What `berth sim` does in a simulated world that runs: devices are plugged in and out, switched, and made to fail,
/// as by the events of the plant file (docs/plant-file.md). The running process answers at its control socket.
#pragma once

#include <string>

#include "berth/command/reply.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::cli {

/// Of a process: what of it `berth sim` works on.
struct RunningPlant {
  plant::World* world = nullptr;  ///< null: no bus is simulated in this process
  const plant::PlantFile* plant = nullptr;
  tree::Session* session = nullptr;  ///< null: nothing is known of slots
};

/// The verb of these requests.
inline constexpr const char* plant_verb = "sim";

/// Where a `berth plant` that listens at `socket` takes them.
[[nodiscard]] inline std::string plant_control(const std::string& socket) { return socket + ".control"; }

/// "action" is one of the plant file's, or "devices", which lists them; "device" names a device or the slot that it
/// sits in; every other argument is a key of the action's event. What is done, or for people why not.
[[nodiscard]] command::Reply do_in_plant(const RunningPlant& running, const command::Request& request);

}  // namespace berth::cli
