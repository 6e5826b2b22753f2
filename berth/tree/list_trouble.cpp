#include "berth/tree/list_trouble.hpp"

#include <fmt/format.h>

#include "berth/base/bytes.hpp"

namespace berth::tree {
namespace {

using manager::NodeIdTrouble;
using places::SlotState;

// 0: it has none, or its serial number is unknown.
std::string device_of(std::uint32_t serial) {
  return serial == 0 ? std::string("a device without a serial number")
                     : fmt::format("the device with serial number {:08X}h", serial);
}

ListTrouble::Trouble words_of(NodeIdTrouble trouble, std::uint32_t serial, const places::SlotSpec& slot,
                              const std::string& path) {
  const NodeId node = slot.id;
  const bool fixed = slot.assign == places::Assign::fixed;
  const std::string device = device_of(serial);
  switch (trouble) {
    case NodeIdTrouble::none:
    case NodeIdTrouble::nobody: break;
    case NodeIdTrouble::kept:
      return {SlotState::absent,
              fmt::format("{} may have node-ID {} in its memory and does not answer: the node-ID is reserved for it; "
                          "switch it on, or `berth sdo write {} 5F0Bh:{:02X} 0` if it will not come back",
                          device, node.value(), path, node.value())};
    case NodeIdTrouble::stranger:
      return {SlotState::wrong_type, fmt::format("{} has node-ID {} and does not belong here", device, node.value())};
    case NodeIdTrouble::doubled:
      return {SlotState::duplicate, "two devices answer under this node-ID; take one of them off the bus"};
    case NodeIdTrouble::refuses:
      return {SlotState::failed,
              fmt::format("{} takes no node-ID by LSS: set its switches to {}", device, node.value())};
    case NodeIdTrouble::power_cycle: return {SlotState::power_cycle, "node-ID stored; switch the device off and on"};
    case NodeIdTrouble::failed:
      return {SlotState::failed, "its device could not be given its node-ID: the gateway's master tries again"};
    case NodeIdTrouble::lost:
      return {SlotState::absent,
              fixed
                  ? fmt::format("{} does not answer; switch it on, or set the switches of a new one to {}", device,
                                node.value())
                  : fmt::format("{} does not answer; switch it on, or bring a new one: that gets its node-ID", device),
              false};
    case NodeIdTrouble::equals:
      return {SlotState::empty,
              "several devices of its type without serial numbers wait for a node-ID, and LSS cannot distinguish them: "
              "switch them on one at a time"};
  }
  return {SlotState::empty, "no device of its type was found", false};
}

}  // namespace

rt::Task<std::uint64_t> ListTrouble::ask(co::SdoAccess& master, std::uint8_t sub) {
  if (now_ < not_before_) co_return 0;
  ++asked_;
  const std::uint16_t object = manager::NodeIdReport::object;
  const auto value = co_await master.read(object, sub);
  if (!value && value.error().code == Errc::aborted) {
    const auto abort = static_cast<od::AbortCode>(value.error().detail);
    // Any other abort may come from a gateway on the way that got no answer.
    constexpr auto by_then = std::chrono::seconds(30);
    if (abort == od::AbortCode::no_object || abort == od::AbortCode::no_sub_index) not_before_ = now_ + by_then;
  }
  if (!value || value->bytes().size() != sizeof(std::uint64_t)) co_return 0;
  co_return load_le<std::uint64_t>(value->bytes().data());
}

// Through gateways, each question costs several on the buses above, and most slots have nothing to report.
rt::Task<bool> ListTrouble::is_troubled(co::SdoAccess& master, NodeId node) {
  const unsigned place = node.value() - 1U;
  auto& mask = troubled_.at(place / 64);
  if (!mask) {
    const auto sub = static_cast<std::uint8_t>(manager::NodeIdReport::troubled + place / 64);
    const auto told = co_await ask(master, sub);
    mask = told;
  }
  co_return (*mask >> place % 64 & 1U) != 0;
}

rt::Task<std::optional<ListTrouble::Trouble>> ListTrouble::of(co::SdoAccess& master, const places::SlotSpec& slot,
                                                              std::string path) {
  const NodeId node = slot.id;
  const bool troubled = co_await is_troubled(master, node);
  if (!troubled) co_return std::nullopt;
  const std::uint8_t sub = node.value();
  const std::uint64_t row = co_await ask(master, sub);
  const auto trouble = static_cast<NodeIdTrouble>(row & 0xFFU);
  if (trouble == NodeIdTrouble::none) co_return std::nullopt;
  co_return words_of(trouble, static_cast<std::uint32_t>(row >> 32U), slot, path);
}

rt::Task<std::string> ListTrouble::surplus(co::SdoAccess& master, bool any_fixed) {
  constexpr auto seldom = std::chrono::seconds(10);
  if (now_ < surplus_at_) co_return std::string();
  surplus_at_ = now_ + seldom;
  const std::uint8_t sub = manager::NodeIdReport::surplus;
  const std::uint64_t row = co_await ask(master, sub);
  const bool news = std::exchange(surplus_, row) != row && row != 0;
  if (!news) co_return std::string();
  const auto count = row & 0xFFU;
  const auto serial = static_cast<std::uint32_t>(row >> 32U);
  co_return fmt::format(
      "{} device{} no place here, the first {}: every slot that {} has its device{}; take {} off the bus{}", count,
      count == 1 ? " has" : "s have",
      serial == 0 ? "without a serial number" : fmt::format("with serial number {:08X}h", serial),
      count == 1 ? "it fits" : "they fit", any_fixed ? ", or is for one with its own node-ID" : "",
      count == 1 ? "it" : "them", any_fixed ? ", or set its switches" : "");
}

}  // namespace berth::tree
