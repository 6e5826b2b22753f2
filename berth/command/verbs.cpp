#include "berth/command/verbs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

constexpr std::array<std::string_view, 1> bus{"bus"};
constexpr std::array<std::string_view, 3> of_bind{"bus", "method", "from-scratch"};
constexpr std::array<std::string_view, 4> of_replace{"bus", "slot", "device", "used"};
constexpr std::array<std::string_view, 2> of_forget{"bus", "device"};
constexpr std::array<std::string_view, 4> of_locate{"bus", "target", "seconds", "anyway"};
constexpr std::array<std::string_view, 3> of_configure{"bus", "slot", "check"};
constexpr std::array<std::string_view, 3> of_upload{"bus", "slot", "dcf"};
constexpr std::array<std::string_view, 6> of_sdo_read{"bus", "node", "object", "sub", "type", "block"};
constexpr std::array<std::string_view, 8> of_sdo_write{"bus",   "node", "object", "sub",
                                                       "value", "type", "block",  "anyway"};
constexpr std::array<std::string_view, 3> of_sdo_probe{"bus", "node", "objects"};
constexpr std::array<std::string_view, 2> of_sdo_dump{"bus", "node"};
constexpr std::array<std::string_view, 5> of_sdo_connect{"bus", "client", "server", "lease", "request"};
constexpr std::array<std::string_view, 4> of_sdo_release{"bus", "client", "server", "request"};
constexpr std::array<std::string_view, 3> of_program{"bus", "node", "number"};
constexpr std::array<std::string_view, 5> of_program_download{"bus", "node", "number", "file", "identification"};
constexpr std::array<std::string_view, 3> of_emcy{"bus", "node", "listen"};
constexpr std::array<std::string_view, 3> of_memory{"bus", "node", "group"};
constexpr std::array<std::string_view, 2> of_send{"bus", "frame"};
constexpr std::array<std::string_view, 2> of_history{"bus", "slot"};
constexpr std::array<std::string_view, 4> of_nmt{"bus", "command", "node", "request"};
constexpr std::array<std::string_view, 2> of_lss_global{"bus", "state"};
constexpr std::array<std::string_view, 2> of_lss_device{"bus", "address"};
constexpr std::array<std::string_view, 4> of_lss_set_node_id{"bus", "address", "id", "store"};
constexpr std::array<std::string_view, 3> of_lss_bit_timing{"bus", "rate", "address"};
constexpr std::array<std::string_view, 3> of_lss_activate{"bus", "delay", "rate"};
constexpr std::array<std::string_view, 7> of_lss_identify{"bus",           "vendor",     "product",    "revision-low",
                                                          "revision-high", "serial-low", "serial-high"};

constexpr std::array table{
    Verb{"report", bus, report},
    Verb{"scan", bus, scan},
    Verb{"bind", of_bind, bind},
    Verb{"replace", of_replace, replace},
    Verb{"forget", of_forget, forget},
    Verb{"locate", of_locate, locate},
    Verb{"boot", bus, boot},
    Verb{"configure", of_configure, configure},
    Verb{"upload", of_upload, upload},
    Verb{"sdo read", of_sdo_read, sdo_read},
    Verb{"sdo write", of_sdo_write, sdo_write},
    Verb{"sdo probe", of_sdo_probe, sdo_probe},
    Verb{"sdo dump", of_sdo_dump, sdo_dump},
    Verb{"sdo connect", of_sdo_connect, sdo_connect},
    Verb{"sdo release", of_sdo_release, sdo_release},
    Verb{"sdo channels", bus, sdo_channels},
    Verb{"nmt", of_nmt, nmt_command},
    Verb{"program status", of_program, program_status},
    Verb{"program download", of_program_download, program_download},
    Verb{"program start", of_program, program_control},
    Verb{"program stop", of_program, program_control},
    Verb{"program clear", of_program, program_control},
    Verb{"emcy", of_emcy, emcy},
    Verb{"store", of_memory, device_memory},
    Verb{"restore", of_memory, device_memory},
    Verb{"send", of_send, send},
    Verb{"history", of_history, history},
    Verb{"lss global", of_lss_global, lss_command},
    Verb{"lss select", of_lss_device, lss_command},
    Verb{"lss inquire", of_lss_device, lss_command},
    Verb{"lss set-node-id", of_lss_set_node_id, lss_command},
    Verb{"lss store", of_lss_device, lss_command},
    Verb{"lss bit-timing", of_lss_bit_timing, lss_command},
    Verb{"lss activate", of_lss_activate, lss_command},
    Verb{"lss identify", of_lss_identify, lss_command},
    Verb{"lss find", bus, lss_command},
    Verb{"lss move-bit-rate", of_lss_activate, bit_rate_command},
};

}  // namespace

std::span<const Verb> verbs() noexcept { return table; }

const Verb* verb(std::string_view name) noexcept {
  const auto* const it = std::ranges::find(table, name, &Verb::name);
  return it == table.end() ? nullptr : it;
}

rt::Task<void> execute(Session& session, const Request& request, Reply& reply) {
  reply = Reply{};
  const Verb* const wanted = verb(request.verb);
  if (wanted == nullptr) {
    co_return refuse(reply, 2, fmt::format("there is no command {}", text::quoted(request.verb)));
  }
  if (confirmed(session, request, reply)) co_await wanted->run(session, request, reply);
}

}  // namespace berth::command
