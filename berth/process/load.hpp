/// A process image from a device's files, made by `berth link` for a slot, or by a configuration tool.
///
///     const auto read = eds::read_file("linked/unloader.dcf");        // with the network variables as objects
///     const auto program = process::load(read.file);
///
///     const auto read = eds::read_file("controller.eds");             // without: they are in the plan
///     const auto program = process::load(read.file, linker::variables_of(plan, "unloader"));
///
///     process::Image image(program.layout);
///     device::Device device(dispatcher, program.description, ...);
///     process::DeviceImage link(device, executor, image.network(), program.bound, {.cycle = 5ms});
///
/// The image contains:
/// - network variables: objects in segments of [DynamicChannels] (CiA 306-3 §5.2.2), by their `Denotation`, else their
///   parameter name; at PPOffset + place in the segment. Segments of access ro and rwr are inputs of the network, of
///   rww and wo outputs (paper 5 §2.1);
/// - every other object from 2000h on that can be mapped into a PDO, by its notation ("2100h:01"), after them. Access
///   ro and rwr: input; rww and wo: output; rw: as the file's PDOs map it, else not included.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "berth/eds/file.hpp"
#include "berth/process/device_image.hpp"
#include "berth/process/network_variables.hpp"

namespace berth::process {

struct Program {
  std::shared_ptr<const od::Description> description;  ///< for making the device
  Layout layout;
  std::vector<Bound> bound;
  std::vector<std::string> problems = {};  ///< objects left out of the image, and why
};

/// `variables`: those that the file does not contain yet.
[[nodiscard]] Program load(const eds::File& file, std::span<const NetworkVariable> variables = {});

}  // namespace berth::process
