// send: frames as the user writes them, through the same gate as all others.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

constexpr rt::Duration patience = std::chrono::seconds(1);  ///< for one frame to get onto the wire

class Left final : public can::Confirmation {
 public:
  void sent(rt::Time at) noexcept override { at_ = at; }
  [[nodiscard]] const std::optional<rt::Time>& at() const noexcept { return at_; }

 private:
  std::optional<rt::Time> at_;
};

}  // namespace

std::vector<can::Frame> frame_arguments(Arguments& arguments) {
  std::vector<can::Frame> frames;
  for (const auto& word : lines_of(arguments.required("frame"))) {
    const auto frame = can::parse_frame(word);
    if (!frame) {
      arguments.wrong(fmt::format("{} is not a frame; write it as candump does: 601#4018100400000000, 00000123#R, 080#",
                                  text::quoted(word)));
      return {};
    }
    frames.push_back(*frame);
  }
  return frames;
}

rt::Task<void> send(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const auto frames = frame_arguments(arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = network_for(session, arguments.text("bus"), Use::send);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  Json json;
  json["bus"] = bus.bus().name;
  json["frames"] = Json::array();
  std::vector<std::string> lines;
  for (const can::Frame& frame : frames) {
    const std::string text = can::to_string(frame);
    Left left;
    const auto queued = bus.services().dispatcher.send(frame, left);
    const rt::Time end = session.executor().now() + patience;
    while (queued == can::Queued::yes && !left.at() && session.executor().now() < end) {
      co_await rt::sleep_for(std::chrono::milliseconds(1));
    }
    if (!left.at()) {
      const std::string why = queued == can::Queued::listen_only ? "the port sends no such frame in this role"
                              : queued == can::Queued::yes       ? "it did not get onto the wire within 1 s"
                                                                 : "the port takes no frame";
      co_return refuse(reply, 3, fmt::format("bus {}: {}: {}", bus.bus().name, text, why));
    }
    json["frames"].push_back({{"frame", text}, {"sent_s", operate::seconds(*left.at())}});
    lines.push_back(fmt::format("{:9.3f} s  {}  {}", operate::seconds(*left.at()), bus.bus().name, text));
  }
  give(reply, json, std::move(lines));
}

}  // namespace berth::command
