#include "second_word.hpp"

#include "ask.hpp"

namespace berth::cli {

std::optional<Failure> no_second_word(MachineRun& run, const Options& options) {
  std::vector<std::string> lines = run.strangers().may_be_masters();
  if (lines.empty() || options.master.beside_another || options.dry_run) return std::nullopt;
  if (!options.json && someone_types()) {
    print_lines(lines);
    if (ask_yes("Shall Berth be a master beside it?", run.interrupt())) return std::nullopt;
  }
  lines.emplace_back(
      "No NMT, LSS or RAND frame was sent. If it is the master: use the bus as role = \"commissioner\" or "
      "\"observer\"; if it is a device: give it a slot, or say --beside-master");
  return failure_in_lines(Exit::no, lines);
}

}  // namespace berth::cli
