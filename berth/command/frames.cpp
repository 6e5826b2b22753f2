// The frames that a command sends, made without a bus.
#include <algorithm>

#include "berth/co/sdo.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/verbs.hpp"

namespace berth::command {
namespace {

using Frames = std::vector<can::Frame>;

constexpr const char* beneath_a_gateway = "what goes through a gateway depends on its answers";

Frames upload_frames(const Request& request, const design::Machine& machine, std::string& problem) {
  Arguments arguments(request);
  const ObjectArguments wanted = object_arguments(arguments, machine);
  problem = arguments.problem();
  if (problem.empty() && !arguments.text("block").empty()) {
    problem = "what a block transfer sends depends on the device's answers";
  }
  if (problem.empty() && !wanted.node.gateways.empty()) problem = beneath_a_gateway;
  if (!problem.empty()) return {};
  return {co::sdo::make(0x600U + wanted.node.node.value(), 0x40, wanted.objects.front().ref)};
}

Frames download_frames(const Request& request, const design::Machine& machine, std::string& problem) {
  Arguments arguments(request);
  const WriteArguments wanted = write_arguments(arguments, machine);
  problem = arguments.problem();
  if (problem.empty() && !wanted.to.node.gateways.empty()) problem = beneath_a_gateway;
  if (!problem.empty()) return {};
  if (!arguments.text("block").empty()) {
    problem = "what a block transfer sends depends on the device's answers";
    return {};
  }
  const auto& bytes = wanted.values.front();
  if (bytes.size() > 4 || bytes.empty()) {
    problem =
        "an empty value, or one of more than four bytes, is sent in segments, which depend on the device's answers";
    return {};
  }
  const auto unused = static_cast<unsigned>(4 - bytes.size());
  can::Frame frame = co::sdo::make(0x600U + wanted.to.node.node.value(),
                                   static_cast<std::uint8_t>(0x23U | unused << 2U), wanted.to.objects.front().ref);
  std::ranges::copy(bytes, frame.data.begin() + 4);
  return {frame};
}

Frames nmt_frames(const Request& request, const design::Machine& machine, std::string& problem) {
  Arguments arguments(request);
  const NmtArguments nmt = nmt_arguments(arguments, machine);
  problem = arguments.problem();
  if (problem.empty() && !nmt.gateways.empty()) problem = beneath_a_gateway;
  if (!problem.empty()) return {};
  if (!nmt.requested_of.configured()) return {co::to_frame({nmt.command, nmt.target})};
  can::Frame frame = co::sdo::make(0x600U + nmt.requested_of.value(), 0x2F, {0x1F82, nmt.request_sub()});
  frame.data[4] = nmt.request_value();
  return {frame};
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
  } else if (lss.service == "identify-unconfigured") {
    frames.push_back(lss::request(lss::Command::identify_non_configured));
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

std::vector<can::Frame> foreseeable_frames(const Request& request, const design::Machine& machine,
                                           std::string& problem) {
  problem.clear();
  if (request.verb == "nmt") return nmt_frames(request, machine, problem);
  if (request.verb == "sdo read") return upload_frames(request, machine, problem);
  if (request.verb == "sdo write") return download_frames(request, machine, problem);
  if (request.verb == "send") {
    Arguments arguments(request);
    const auto frames = frame_arguments(arguments);
    problem = arguments.problem();
    return frames;
  }
  if (request.verb.starts_with("lss ")) return lss_frames(request, problem);
  problem = "what `" + request.verb + "` sends depends on the devices' answers";
  return {};
}

}  // namespace berth::command
