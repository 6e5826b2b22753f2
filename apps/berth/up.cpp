// `berth up`, and what `berth demo` shares with it.
#include "up.hpp"

#include <fmt/format.h>

#include <optional>

#include "ask.hpp"
#include "berth/operate/control.hpp"
#include "drive.hpp"
#include "ports.hpp"

namespace berth::cli {
namespace {

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

// Where other commands reach this one. A process for one of several buses leaves the machine's name to whoever runs
// them all.
std::string control_of(Rig& rig, const Options& options) {
  if (rig.loop() == nullptr || options.dry_run) return {};
  if (!options.control.empty()) return options.control;
  const auto& name = rig.machine().name;
  return operate::control_path(!rig.guards().empty() && !options.bus.empty() ? bus_process(name, options.bus) : name);
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
  return ask_yes("Start it?");
}

Failure unconfirmed(Rig& rig) {
  return failure(Exit::no, first_start_text(rig) +
                               "\nNothing was sent. Confirm it with --yes; --dry-run shows what "
                               "would be sent first");
}

// Another master on a bus, or no consent of a person's: nothing is started.
std::optional<Failure> refusal(Rig& rig, const Options& options) {
  if (const auto clear = rig.strangers().listen_first(); !clear) return clear.error();
  if (!options.dry_run && !confirmed(rig, options)) return unconfirmed(rig);
  if (const auto alone = rig.strangers().ask(); !alone) return alone.error();
  return std::nullopt;
}

// `table`: the slots were not on the screen all the time.
void print_outcome(Rig& rig, const Options& options, const std::vector<Recorded>& sent, bool table) {
  if (options.dry_run) {
    print_dry_run(sent, nullptr, options.json);
  } else if (options.json) {
    print_line(operate::to_json(rig.session().report()));
  } else if (table) {
    print_line("");
    print_lines(operate::to_table(rig.session().slots()));
  }
}

}  // namespace

int bring_up(const Options& wanted, const Sources& sources) {
  Options options = wanted;
  bool live = on_terminal() && !options.json && !options.dry_run;
  options.pace = (options.pace || live) && !options.fast && !options.dry_run;
  auto made = Rig::make(options, sources);
  if (!made) return tell(made.error(), options.json);
  Rig& rig = **made;
  live = live && rig.loop() != nullptr;
  std::vector<Recorded> sent;
  if (options.dry_run) rig.record().collect_sent(sent);
  if (const auto no = refusal(rig, options)) return tell(*no, options.json);
  Screen screen(rig.session(), live, options.json || options.dry_run);
  Ending ending(rig, options.until);
  const auto ended = drive(rig, ending, screen, options, control_of(rig, options));
  if (!ended) return tell(ended.error(), options.json);
  const bool good =
      rig.session().operational() && (*ended != Ended::settled || options.until != "replaced" || ending.reached());
  if (!options.dry_run) rig.leave(options);
  print_outcome(rig, options, sent, !live);
  if (options.dry_run && !rig.guards().empty()) return Exit::done;
  if (!rig.record().kept())
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
