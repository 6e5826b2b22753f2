// program status, download, start, stop, clear: the programs of a device (docs/programs.md).
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/co/sdo_access.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/manager/program_loader.hpp"
#include "berth/od/cia302.hpp"
#include "berth/operate/programming.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

using manager::ProgramControl;
using manager::ProgramProgress;
using manager::ProgramStage;

struct ProgramRequest {
  NodeArgument node;
  Network* network = nullptr;
  const design::Slot* slot = nullptr;
  std::optional<std::uint8_t> number;
  std::string file;
  std::optional<std::uint32_t> identification;

  [[nodiscard]] std::uint8_t one() const noexcept { return number.value_or(1); }
};

tl::expected<ProgramRequest, std::string> read_program_request(Session& session, const Request& request, Use use) {
  Arguments arguments(request);
  ProgramRequest wanted;
  wanted.node = node_argument(arguments, session.machine());
  if (arguments.has("number")) wanted.number = static_cast<std::uint8_t>(arguments.number("number", 1, 254));
  wanted.file = arguments.text("file");
  if (arguments.has("identification")) wanted.identification = arguments.number("identification", 1, 0xFFFF'FFFF);
  if (!arguments.good()) return tl::unexpected(arguments.problem());
  const auto network = node_network(session, wanted.node, Place::beneath_too);
  if (!network) return tl::unexpected(network.error());
  const auto allowed = network_for(session, (*network)->bus().name, use);
  if (!allowed) return tl::unexpected(allowed.error());
  wanted.network = *network;
  const auto of_node = [&](const design::Slot& slot) {
    const auto way = tree::way_to(session.machine(), slot.spec.name.bus);
    return slot.spec.id == wanted.node.node && way.bus == wanted.network->bus().name &&
           way.gateways == wanted.node.gateways;
  };
  const auto& slots = session.machine().slots;
  const auto slot = std::ranges::find_if(slots, of_node);
  wanted.slot = slot == slots.end() ? nullptr : &*slot;
  return wanted;
}

const places::SlotProgram* slot_program(const ProgramRequest& wanted, std::uint8_t number) {
  if (wanted.slot == nullptr) return nullptr;
  const auto& programs = wanted.slot->spec.software.programs;
  const auto it = std::ranges::find(programs, number, &places::SlotProgram::number);
  return it == programs.end() ? nullptr : &*it;
}

std::string where(const ProgramRequest& wanted) {
  return fmt::format("bus {}, node {}", wanted.network->bus().name, wanted.node.text());
}

Json head_of(const ProgramRequest& wanted) {
  Json json;
  json["bus"] = wanted.network->bus().name;
  json["node"] = wanted.node.node.value();
  if (!wanted.node.gateways.empty()) json["path"] = wanted.node.text();
  if (wanted.slot != nullptr) json["slot"] = wanted.slot->spec.name.name;
  return json;
}

// ---- status ---------------------------------------------------------------------------------------------------------

struct ProgramState {
  std::uint8_t number = 1;
  ProgramControl control = ProgramControl::clear;
  std::optional<std::uint32_t> identification;
  std::optional<std::uint32_t> flash;
};

rt::Task<Result<ProgramState>> state_of(co::SdoAccess& device, std::uint8_t number) {
  const auto control = co_await device.read_up_to(od::cia302::program_control, number, 4);
  if (!control) co_return fail(control.error());
  ProgramState state;
  state.number = number;
  if (!control->bytes().empty()) state.control = static_cast<ProgramControl>(control->bytes().front());
  const auto identification = co_await device.read_u32(od::cia302::program_identification, number);
  if (identification) state.identification = *identification;
  const auto flash = co_await device.read_u32(od::cia302::flash_status, number);
  if (flash) state.flash = *flash;
  co_return state;
}

std::optional<std::uint32_t> expected_of(const ProgramRequest& wanted, std::uint8_t number) {
  const auto* const program = slot_program(wanted, number);
  if (program == nullptr) return std::nullopt;
  if (program->identification) return program->identification;
  const auto image = operate::load_program(program->file);
  return image ? std::optional(image->identification) : std::nullopt;
}

void put(Json& list, std::vector<std::string>& lines, const ProgramState& state, const ProgramRequest& wanted) {
  Json json;
  json["program"] = state.number;
  json["state"] = std::string(name(state.control));
  std::string line = fmt::format("program {:>3}  {:<10}", state.number, name(state.control));
  if (state.identification) json["identification"] = hex(*state.identification);
  if (state.identification) line += fmt::format("  {:08X}h", *state.identification);
  if (state.flash) {
    json["flash"] = {{"busy", manager::flash_busy(*state.flash)}, {"error", manager::flash_error(*state.flash)}};
    if (manager::flash_busy(*state.flash)) line += "  its flash memory is busy";
    if (const std::string error = manager::flash_error(*state.flash); !error.empty()) line += "  " + error;
  }
  const auto expected = expected_of(wanted, state.number);
  if (expected && state.identification) {
    json["expected"] = hex(*expected);
    if (*expected != *state.identification) line += fmt::format("  the slot wants {:08X}h", *expected);
  }
  list.push_back(std::move(json));
  lines.push_back(std::move(line));
}

}  // namespace

rt::Task<void> program_status(Session& session, const Request& request, Reply& reply) {
  const auto wanted = read_program_request(session, request, Use::send);
  if (!wanted) co_return refuse(reply, 2, wanted.error());
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = wanted->network->services().sdo.options();
  co::SdoAccess& device = objects_of(session, *wanted->network, wanted->node, how, direct);
  std::uint8_t first = wanted->one();
  std::uint8_t last = first;
  if (!wanted->number) {
    const auto count = co_await device.read_up_to(od::cia302::program_control, 0, 4);
    if (!count) {
      co_return fail_with(reply, count.error(), where(*wanted) + ", programs (1F51h)",
                          "a device that is not programmed over the bus has no such object");
    }
    last = count->bytes().empty() ? std::uint8_t{1} : std::clamp<std::uint8_t>(count->bytes().front(), 1, 254);
  }
  Json json = head_of(*wanted);
  json["programs"] = Json::array();
  std::vector<std::string> lines;
  bool all = true;
  for (unsigned number = first; number <= last; ++number) {
    const auto state = co_await state_of(device, static_cast<std::uint8_t>(number));
    if (!state)
      co_return fail_with(reply, state.error(), where(*wanted) + ", program control (1F51h)", "", wanted->node.path());
    put(json["programs"], lines, *state, *wanted);
    all = all && state->control == ProgramControl::start;
  }
  const auto days = co_await device.read_u32(od::cia302::program_date, 1);
  const auto ms = co_await device.read_u32(od::cia302::program_date, 2);
  const bool dated = days && ms && *days != 0 && *days < 100'000 && *ms < 86'400'000;
  if (dated) json["date"] = manager::to_string(manager::ConfigurationDate{*days, *ms});
  if (dated) lines.push_back("the latest is of " + json["date"].get<std::string>());
  give(reply, json, std::move(lines));
  reply.status = all ? 0 : 1;
}

// ---- control --------------------------------------------------------------------------------------------------------

rt::Task<void> program_control(Session& session, const Request& request, Reply& reply) {
  const auto wanted = read_program_request(session, request, Use::command);
  if (!wanted) co_return refuse(reply, 2, wanted.error());
  Network& bus = *wanted->network;
  co_await bus.services().turn.take();
  const rt::Held held(bus.services().turn);
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& device = objects_of(session, bus, wanted->node, how, direct);
  manager::ProgramOptions options;
  options.restart_time = bus.bus().timing.boot_timeout;
  const std::uint8_t number = wanted->one();
  Result<void> done;
  std::string what;
  if (request.verb == "program start") {
    done = co_await manager::start_program(device, number, options);
    what = "started";
  } else if (request.verb == "program stop") {
    done = co_await manager::stop_program(device, number, options);
    what = "stopped";
  } else {
    done = co_await manager::clear_program(device, number, options);
    what = "cleared";
  }
  if (!done) {
    const bool runs = request.verb == "program clear" && done.error().code == Errc::aborted;
    co_return fail_with(reply, done.error(), fmt::format("{}, program {}", where(*wanted), number),
                        runs ? "a program that runs is stopped first: `berth program stop`" : "");
  }
  Json json = head_of(*wanted);
  json["program"] = number;
  json["result"] = what;
  give(reply, json, {fmt::format("node {}  program {} {}", wanted->node.text(), number, what)});
}

// ---- download -------------------------------------------------------------------------------------------------------

namespace {

struct Download {
  std::vector<operate::ProgramImage> images;
  std::vector<manager::ProgramWish> wishes;
};

// Returns the problem as text for the user.
std::string read_images(const ProgramRequest& wanted, Download& download) {
  std::vector<places::SlotProgram> programs;
  if (!wanted.file.empty()) {
    programs.push_back({wanted.one(), wanted.file, wanted.identification});
  } else if (wanted.slot != nullptr) {
    for (const auto& each : wanted.slot->spec.software.programs) {
      if (!wanted.number || *wanted.number == each.number) programs.push_back(each);
    }
  }
  if (wanted.identification && programs.size() == 1) programs.front().identification = wanted.identification;
  if (wanted.identification && programs.size() > 1) {
    return "--identification is of one program, and the slot has several: name one by --program";
  }
  if (programs.empty()) {
    return "it is not known which program: name its image by --file, or by programs = [{ file = \"…\" }] in its slot";
  }
  for (const auto& program : programs) {
    auto image = operate::load_program(program.file);
    if (!image) return fmt::format("{}: {}", text::quoted(program.file), image.error().text);
    download.images.push_back(*std::move(image));
  }
  for (std::size_t i = 0; i < programs.size(); ++i) {
    const auto& image = download.images[i];
    download.wishes.push_back({.number = programs[i].number,
                               .image = image.bytes,
                               .identification = programs[i].identification.value_or(image.identification)});
  }
  return {};
}

const char* advice_of(const Error& error) noexcept {
  constexpr std::uint32_t unknown_format = 2;  // 1F57h, bits 1 to 7 (CiA 302-3)
  return error.index == od::cia302::flash_status && error.detail == unknown_format
             ? "the device stays in its boot loader; give it an image as its maker builds it: for a device of Berth's "
               "`berth program image` makes one of a binary"
             : "the device stays in its boot loader; `berth program status` says more";
}

std::string progress_line(const ProgramRequest& wanted, const ProgramProgress& p) {
  const std::string whose = fmt::format("node {}: {} program {}", wanted.node.text(), name(p.stage), p.number);
  if (p.stage != ProgramStage::downloading || p.done == 0) return whose;
  return fmt::format("{}: {} % of {} bytes", whose, p.done * 100 / std::max<std::size_t>(p.total, 1), p.total);
}

}  // namespace

rt::Task<void> program_download(Session& session, const Request& request, Reply& reply) {
  const auto wanted = read_program_request(session, request, Use::command);
  if (!wanted) co_return refuse(reply, 2, wanted.error());
  Download download;
  const std::string problem = read_images(*wanted, download);
  if (!problem.empty()) co_return refuse(reply, 2, problem);
  Network& bus = *wanted->network;
  co_await bus.services().turn.take();
  const rt::Held held(bus.services().turn);
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& device = objects_of(session, bus, wanted->node, how, direct);
  for (std::size_t i = 0; i < download.images.size(); ++i) {
    const auto suited = co_await operate::suits(download.images[i], device);
    if (suited) continue;
    co_return fail_with(reply, suited.error(), fmt::format("{}, program {}", where(*wanted), download.wishes[i].number),
                        "", wanted->node.path());
  }
  manager::ProgramTransfers transfers(bus.services().dispatcher);
  manager::ProgramOptions options;
  options.transfers = &transfers;
  options.restart_time = bus.bus().timing.boot_timeout;
  std::size_t twentieth = 0;
  options.progress = [&session, &wanted, &twentieth, &reply](const ProgramProgress& p) {
    const std::size_t now = p.total == 0 ? 0 : p.done * 20 / p.total;
    const bool tells = p.stage != ProgramStage::downloading || now != twentieth || p.done == 0;
    twentieth = now;
    if (!tells) return;
    const std::string line = progress_line(*wanted, p);
    session.tell(wanted->network->bus().name, operate::EventKind::step, line);
    reply.tell(line);
  };
  manager::ProgramLoader loader(device, download.wishes, options);
  manager::ProgramReport report;
  const auto done = co_await loader.run(report);
  if (!done) {
    co_return fail_with(reply, done.error(),
                        fmt::format("{}, program {}, {}", where(*wanted), report.number, name(report.stage)),
                        advice_of(done.error()));
  }
  Json json = head_of(*wanted);
  json["bytes"] = report.bytes;
  json["tries"] = report.tries;
  json["programs"] = Json::array();
  for (const auto& wish : download.wishes) {
    json["programs"].push_back({{"program", wish.number}, {"identification", hex(wish.identification)}});
  }
  give(reply, json,
       {fmt::format("node {}  {} program{} downloaded and started, {} bytes", wanted->node.text(),
                    download.wishes.size(), download.wishes.size() == 1 ? "" : "s", report.bytes)});
}

}  // namespace berth::command
