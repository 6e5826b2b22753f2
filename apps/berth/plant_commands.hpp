/// `berth sim` acts on a running simulated world: it plugs devices in and out, switches them, and makes them fail, as
/// the events of the plant file do (docs/plant-file.md). The running process answers at its control socket.
#pragma once

#include <string>

#include "berth/command/reply.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::cli {

/// The parts of a process on which `berth sim` works.
struct RunningPlant {
  plant::World* world = nullptr;  ///< null: this process simulates no bus
  const plant::PlantFile* plant = nullptr;
  tree::Session* session = nullptr;  ///< null: no slots are known
};

/// The verb of these requests.
inline constexpr const char* plant_verb = "sim";

/// Where a `berth plant` that listens at `socket` takes such requests.
[[nodiscard]] inline std::string plant_control(const std::string& socket) { return socket + ".control"; }

/// "action" is an action of the plant file, or "devices", which lists them; "device" names a device or the slot of one;
/// every other argument is a key of the action's event. The reply says what is done, or why not.
[[nodiscard]] command::Reply do_in_plant(const RunningPlant& running, const command::Request& request);

}  // namespace berth::cli
