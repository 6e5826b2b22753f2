// What a command sends, without a bus.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/co/sdo.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/verbs.hpp"

namespace berth::command {
namespace {

using Frames = std::vector<can::Frame>;

Frames sdo_frames(const Request& request, bool write, std::string& problem) {
  Arguments arguments(request);
  const ObjectArguments object = object_arguments(arguments);
  if (write && !request.arguments.contains("value")) arguments.wrong("\"sdo write\" needs value");
  const std::string text = arguments.text("value");
  problem = arguments.problem();
  if (problem.empty() && !arguments.text("block").empty()) {
    problem = "what a block transfer sends depends on the device's answers";
  }
  if (!problem.empty()) return {};
  const std::uint32_t id = 0x600U + object.node.value();
  if (!write) return {co::sdo::make(id, 0x40, {object.index, object.sub})};
  const auto bytes = value_bytes(object.type, text, object.node);
  if (!bytes) problem = bytes.error();
  if (!bytes) return {};
  if (bytes->size() > 4 || bytes->empty()) {
    problem = "a value of no or more than four bytes goes in segments, which depend on the device's answers";
    return {};
  }
  const auto unused = static_cast<unsigned>(4 - bytes->size());
  can::Frame frame = co::sdo::make(id, static_cast<std::uint8_t>(0x23U | unused << 2U), {object.index, object.sub});
  std::ranges::copy(*bytes, frame.data.begin() + 4);
  return {frame};
}

Frames nmt_frames(const Request& request, std::string& problem) {
  Arguments arguments(request);
  const NmtArguments nmt = nmt_arguments(arguments);
  problem = arguments.problem();
  if (!problem.empty()) return {};
  return {co::to_frame({nmt.command, nmt.target})};
}

Frames lss_frames(const Request& request, std::string& problem) {
  if (request.verb == "lss move-bit-rate") {
    problem = "what `lss move-bit-rate` sends depends on the devices' answers";
    return {};
  }
  const LssArguments lss = lss_arguments(request, problem);
  if (!problem.empty()) return {};
  Frames frames;
  const auto select = [&](const LssAddress& device) {
    frames.push_back(lss::request(lss::Command::switch_global, 0));
    for (unsigned i = 0; i < 4; ++i) frames.push_back(lss::request_select(device, i));
  };
  if (lss.service == "global") {
    frames.push_back(lss::request(lss::Command::switch_global, static_cast<std::uint8_t>(lss.state)));
  } else if (lss.service == "select") {
    select(*lss.device);
  } else if (lss.service == "identify") {
    for (unsigned i = 0; i < 6; ++i) frames.push_back(lss::request_identify(lss.ranges, i));
  } else if (lss.service == "activate") {
    frames.push_back(lss::request_activate(lss.delay_ms));
  } else if (lss.service == "store" && !lss.device) {
    frames.push_back(lss::request(lss::Command::store));
  } else {
    problem = "what `lss " + lss.service + "` sends depends on the devices' answers";
  }
  return frames;
}

}  // namespace

std::vector<can::Frame> foreseeable_frames(const Request& request, std::string& problem) {
  problem.clear();
  if (request.verb == "nmt") return nmt_frames(request, problem);
  if (request.verb == "sdo read") return sdo_frames(request, false, problem);
  if (request.verb == "sdo write") return sdo_frames(request, true, problem);
  if (request.verb.starts_with("lss ")) return lss_frames(request, problem);
  problem = "what `" + request.verb + "` sends depends on the devices' answers";
  return {};
}

}  // namespace berth::command
