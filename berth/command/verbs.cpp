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

constexpr std::array<Parameter, 1> bus{{{"bus"}}};
constexpr std::array<Parameter, 3> of_bind{{{"bus"}, {"method"}, {"from-scratch", true}}};
constexpr std::array<Parameter, 4> of_replace{{{"bus"}, {"slot"}, {"device"}, {"used"}}};
constexpr std::array<Parameter, 2> of_forget{{{"bus"}, {"device"}}};
constexpr std::array<Parameter, 4> of_locate{{{"bus"}, {"target"}, {"seconds"}, {"anyway"}}};
constexpr std::array<Parameter, 3> of_configure{{{"bus"}, {"slot"}, {"check"}}};
constexpr std::array<Parameter, 3> of_upload{{{"bus"}, {"slot"}, {"dcf"}}};
constexpr std::array<Parameter, 6> of_sdo_read{{{"bus"}, {"node"}, {"object"}, {"sub"}, {"type"}, {"block"}}};
constexpr std::array<Parameter, 8> of_sdo_write{
    {{"bus"}, {"node"}, {"object"}, {"sub"}, {"value"}, {"type"}, {"block"}, {"anyway"}}};
constexpr std::array<Parameter, 3> of_sdo_probe{{{"bus"}, {"node"}, {"objects"}}};
constexpr std::array<Parameter, 2> of_sdo_dump{{{"bus"}, {"node"}}};
constexpr std::array<Parameter, 5> of_sdo_connect{{{"bus"}, {"client"}, {"server"}, {"lease"}, {"request"}}};
constexpr std::array<Parameter, 4> of_sdo_release{{{"bus"}, {"client"}, {"server"}, {"request"}}};
constexpr std::array<Parameter, 3> of_program{{{"bus"}, {"node"}, {"number"}}};
constexpr std::array<Parameter, 5> of_program_download{
    {{"bus"}, {"node"}, {"number"}, {"file", true}, {"identification"}}};
constexpr std::array<Parameter, 3> of_emcy{{{"bus"}, {"node"}, {"listen"}}};
constexpr std::array<Parameter, 3> of_memory{{{"bus"}, {"node"}, {"group"}}};
constexpr std::array<Parameter, 2> of_send{{{"bus"}, {"frame"}}};
constexpr std::array<Parameter, 2> of_history{{{"bus"}, {"slot"}}};
constexpr std::array<Parameter, 4> of_nmt{{{"bus"}, {"command"}, {"node"}, {"request"}}};
constexpr std::array<Parameter, 2> of_lss_global{{{"bus"}, {"state"}}};
constexpr std::array<Parameter, 2> of_lss_device{{{"bus"}, {"address"}}};
constexpr std::array<Parameter, 4> of_lss_set_node_id{{{"bus"}, {"address"}, {"id"}, {"store"}}};
constexpr std::array<Parameter, 3> of_lss_bit_timing{{{"bus"}, {"rate"}, {"address"}}};
constexpr std::array<Parameter, 3> of_lss_activate{{{"bus"}, {"delay"}, {"rate"}}};
constexpr std::array<Parameter, 7> of_lss_identify{
    {{"bus"}, {"vendor"}, {"product"}, {"revision-low"}, {"revision-high"}, {"serial-low"}, {"serial-high"}}};

constexpr auto asks = Effect::asks;
constexpr auto changes = Effect::changes;

constexpr std::array table{
    Verb{"report", asks, bus, report},
    Verb{"scan", asks, bus, scan},
    Verb{"bind", changes, of_bind, bind},
    Verb{"replace", changes, of_replace, replace},
    Verb{"forget", changes, of_forget, forget},
    Verb{"locate", changes, of_locate, locate},
    Verb{"boot", changes, bus, boot},
    Verb{"configure", changes, of_configure, configure},
    Verb{"upload", changes, of_upload, upload},
    Verb{"sdo read", asks, of_sdo_read, sdo_read},
    Verb{"sdo write", changes, of_sdo_write, sdo_write},
    Verb{"sdo probe", asks, of_sdo_probe, sdo_probe},
    Verb{"sdo dump", asks, of_sdo_dump, sdo_dump},
    Verb{"sdo connect", changes, of_sdo_connect, sdo_connect},
    Verb{"sdo release", changes, of_sdo_release, sdo_release},
    Verb{"sdo channels", asks, bus, sdo_channels},
    Verb{"nmt", changes, of_nmt, nmt_command},
    Verb{"program status", asks, of_program, program_status},
    Verb{"program download", changes, of_program_download, program_download},
    Verb{"program start", changes, of_program, program_control},
    Verb{"program stop", changes, of_program, program_control},
    Verb{"program clear", changes, of_program, program_control},
    Verb{"emcy", asks, of_emcy, emcy},
    Verb{"store", changes, of_memory, device_memory},
    Verb{"restore", changes, of_memory, device_memory},
    Verb{"send", changes, of_send, send},
    Verb{"history", asks, of_history, history},
    Verb{"lss global", changes, of_lss_global, lss_command},
    Verb{"lss select", changes, of_lss_device, lss_command},
    Verb{"lss inquire", asks, of_lss_device, lss_command},
    Verb{"lss set-node-id", changes, of_lss_set_node_id, lss_command},
    Verb{"lss store", changes, of_lss_device, lss_command},
    Verb{"lss bit-timing", changes, of_lss_bit_timing, lss_command},
    Verb{"lss activate", changes, of_lss_activate, lss_command},
    Verb{"lss identify", asks, of_lss_identify, lss_command},
    Verb{"lss find", asks, bus, lss_command},
    Verb{"lss move-bit-rate", changes, of_lss_activate, bit_rate_command},
};

constexpr Parameter confirmation{"yes", true};

}  // namespace

const Parameter* Verb::parameter(std::string_view wanted) const noexcept {
  if (wanted == confirmation.name) return &confirmation;
  const auto it = std::ranges::find(parameters, wanted, &Parameter::name);
  return it == parameters.end() ? nullptr : &*it;
}

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
