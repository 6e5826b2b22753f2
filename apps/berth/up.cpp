// `berth up`, and what `berth demo` shares with it.
#include "up.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/trace/candump.hpp"
#include "drive.hpp"
#include "ports.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

// Why it is not operational, one line a slot.
std::string reasons(operate::Session& session, Ended ended) {
  std::string text = ended == Ended::timeout ? "the time allowed is over" : "";
  for (const auto& s : session.slots()) {
    const design::Slot* const slot = session.machine().slot(s.bus, s.id);
    const bool optional = slot != nullptr && slot->spec.optional;
    if (optional || s.state == places::SlotState::operational) continue;
    text += fmt::format("{}bus {}, slot {} (node-ID {}): {}{}", text.empty() ? "" : "\n", s.bus, s.name, s.id.value(),
                        places::name(s.state), s.reason.empty() ? "" : ": " + s.reason);
  }
  return "not operational: " + text;
}

void print_frames(const std::vector<Recorded>& frames, bool json) {
  if (json) {
    Json all;
    all["dry_run"] = true;
    all["frames"] = Json::array();
    for (const auto& f : frames) all["frames"].push_back({{"at_s", f.at_s}, {"bus", f.bus}, {"frame", f.frame}});
    return print_line(all.dump(2));
  }
  for (const auto& f : frames) print_line(candump_line(f));
}

// A process for one of several buses leaves the machine's name to the one that runs them all.
std::string process_name(Rig& rig, const Options& options) {
  const auto& name = rig.machine().name;
  return rig.loop() != nullptr && !options.bus.empty() ? bus_process(name, options.bus) : name;
}

std::string first_start_text(Rig& rig) {
  std::string text = fmt::format("this is the first start of {}: no slot has a device yet.", rig.machine().name);
  for (const auto& bus : rig.machine().buses) {
    if (!is_real(bus.port) || bus.role == design::Role::observer) continue;
    text += fmt::format(
        "\nbus {} on {}: Berth will search for devices (LSS, RAND), give the {} slots' node-IDs to those that fit and "
        "let them store these{}",
        bus.name, can::to_string(bus.port), rig.machine().specs(bus.name).size(),
        bus.role == design::Role::master ? ", reset and configure them, and start them: outputs may switch" : "");
  }
  return text;
}

bool confirmed(Rig& rig, const Options& options) {
  if (options.yes || !rig.first_start()) return true;
  if (options.json || !someone_types()) return false;
  print_line(first_start_text(rig));
  return ask_yes("Start it?", rig.interrupt());
}

Failure unconfirmed(Rig& rig) {
  return failure(Exit::no, first_start_text(rig) +
                               "\nNothing was sent. Confirm it with --yes; --dry-run shows what "
                               "would be sent first");
}

}  // namespace

std::string candump_line(const Recorded& f) {
  return trace::candump_line(rt::Duration(std::llround(f.at_s * 1e9)), f.bus, f.frame);
}

int bring_up(const Options& options, const Sources& sources) {
  auto made = Rig::make(options, sources);
  if (!made) return tell(made.error(), options.json);
  Rig& rig = **made;
  std::vector<Recorded> sent;
  if (options.dry_run) rig.record_sent(sent);
  DriveOptions how;
  const bool live = on_terminal() && !options.json && !options.dry_run;
  how.paced = rig.loop() != nullptr || (!options.dry_run && !options.fast && (options.pace || live));
  if (const auto clear = rig.listen_first(); !clear) return tell(clear.error(), options.json);
  if (!options.dry_run && !confirmed(rig, options)) return tell(unconfirmed(rig), options.json);
  if (const auto alone = rig.ask_strangers(); !alone) return tell(alone.error(), options.json);
  if (how.paced && !options.dry_run)
    how.control = options.control.empty() ? operate::control_path(process_name(rig, options)) : options.control;
  Screen screen(rig.session(), live && how.paced, options.json || options.dry_run);
  Ending ending(rig, options.until);
  const auto ended = drive(rig, ending, screen, options, how);
  if (!ended) return tell(ended.error(), options.json);
  rig.session().on_event({});
  const bool good =
      rig.session().operational() && (*ended != Ended::settled || options.until != "replaced" || ending.reached());
  if (!options.dry_run) rig.leave(options);
  if (options.dry_run) {
    print_frames(sent, options.json);
    if (rig.loop() != nullptr) return Exit::done;
  } else if (options.json) {
    print_line(operate::to_json(rig.session().report()));
  } else if (!live || !how.paced) {
    print_line("");
    print_lines(operate::to_table(rig.session().slots()));
  }
  if (!rig.record_kept())
    return tell(failure(Exit::failed, options.record + ": the record could not be written"), false);
  if (good) return Exit::done;
  screen.keep();
  if (!options.json) {
    print_error(rig.session().operational() ? "no device was replaced" : reasons(rig.session(), *ended));
  }
  return Exit::no;
}

int run_up(const Options& options) {
  if (options.machine.empty())
    return tell(failure(Exit::usage, "name the machine file: berth up machine.toml"), options.json);
  Options own = options;
  own.makes_store = true;
  return bring_up(own, {options.machine, options.sim, {}, {}});
}

}  // namespace berth::cli
