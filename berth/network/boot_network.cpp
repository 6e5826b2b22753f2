#include "berth/network/boot_network.hpp"

#include <fmt/format.h>
#include <array>

namespace berth::network {
namespace {

using Kind = NetworkEvent::Kind;

struct EventWords {
  std::string_view name;
  std::string_view text;
};

constexpr std::array event_words{
    EventWords{"begun", "the slaves are reset and booted"},
    EventWords{"slave_ready", "ready"},
    EventWords{"slave_started", "started"},
    EventWords{"slave_failed", "not ready"},
    EventWords{"slave_lost", "error control lost it"},
    EventWords{"slave_back", "it is heard again"},
    EventWords{"slave_rebooted", "it booted while it ran: power, watchdog or another master"},
    EventWords{"stranger", "it booted"},
    EventWords{"halted", "the startup is halted: this mandatory slave is not ready"},
    EventWords{"ready", "all mandatory slaves are ready"},
    EventWords{"operational", "the network is operational"},
    EventWords{"all_stopped", "all nodes are stopped for an error of this mandatory slave (1F80h bit 6)"},
    EventWords{"all_reset", "all nodes are reset for an error of this mandatory slave (1F80h bit 4)"},
    EventWords{"not_sent", "an NMT command could not be sent"},
};
static_assert(event_words.size() == static_cast<std::size_t>(Kind::not_sent) + 1);

constexpr std::array<std::string_view, 6> phase_names{"idle", "booting", "ready", "started", "failed", "awaited"};

const EventWords& words_of(Kind kind) noexcept { return event_words[static_cast<std::size_t>(kind)]; }

}  // namespace

std::string_view name(SlavePhase phase) noexcept { return phase_names[static_cast<std::size_t>(phase)]; }
std::string_view name(NetworkEvent::Kind kind) noexcept { return words_of(kind).name; }

std::string text(const NetworkEvent& event) {
  std::string line(words_of(event.kind).text);
  if (event.node.configured()) line = fmt::format("node {}: {}", event.node.value(), line);
  if (event.status != manager::BootStatus::booted) {
    line += fmt::format(": {}", BootResult{.status = event.status, .detail = event.detail}.text());
    const auto what_to_do = advice(event.status);
    if (!what_to_do.empty()) line += fmt::format("; {}", what_to_do);
  } else if (!event.detail.empty()) {
    line += fmt::format(": {}", event.detail);
  }
  return line;
}

}  // namespace berth::network
