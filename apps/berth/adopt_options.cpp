// The command line of `berth adopt`, `berth export` and `berth import`.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "adopt.hpp"
#include "berth/text/quantity.hpp"
#include "time_option.hpp"

namespace berth::cli {

namespace {

void add_adopting(CLI::App& app, Options& options, std::function<int()>& action) {
  auto* const sub = app.add_subcommand("adopt", "a machine that runs gets its machine file and bindings, undisturbed");
  const auto wanted = std::make_shared<AdoptOptions>();
  sub->callback([&options, &action, wanted] { action = [&options, wanted] { return run_adopt(options, *wanted); }; });
  sub->add_option("file", wanted->file, "machine file to write")->required()->option_text("MACHINE");
  sub->add_option("--port", options.ports, "port of the bus")->required()->option_text("PORT")->expected(1);
  sub->add_option("--bitrate", wanted->bitrate, "bit/s (default 125000)")
      ->check(CLI::IsMember({10'000, 20'000, 50'000, 125'000, 250'000, 500'000, 800'000, 1'000'000}));
  sub->add_option("--bus", options.bus, "its name in the machine file (default: field)");
  sub->add_option("--name", wanted->name, "name of the machine (default: adopted)");
  sub->add_option("--store", options.store, "slot table to write (default: beside the machine file, .db)");
  time_option(
      *sub, "--for", [wanted](std::chrono::nanoseconds time) { wanted->listen = time; },
      "how long to listen (default: 8 s)");
  auto* const passive = sub->add_flag("--passive", wanted->passive, "send nothing: only what is heard is told");
  sub->add_flag("--all", wanted->everybody, "ask silent node-IDs, too")->excludes(passive);
  sub->add_option("--master", wanted->master, "node-ID of the master that runs it: it gets no slot")
      ->check(CLI::Range(1, 127));
  sub->add_flag("--json", options.json, "one JSON object");
  sub->footer(
      "Sends SDO upload requests (1000h, 1018h, 1008h to 100Ah) and nothing else; a node that another SDO "
      "client talks to is left alone.\nExample:\n  berth adopt conveyor.toml --port socketcan:can0 --bitrate "
      "250000");
}

void add_moving(CLI::App& app, Options& options, std::function<int()>& action) {
  const auto file = std::make_shared<std::string>();
  const auto folder = std::make_shared<std::string>();
  auto* const out = app.add_subcommand("export", "machine file, the files it names and its slot table as one file");
  out->callback([&options, &action, file] { action = [&options, file] { return run_export(options, *file); }; });
  out->add_option("machine", options.machine, "machine file")->required()->option_text("MACHINE");
  out->add_option("to", *file, "file to write")->required()->option_text("FILE");
  out->add_option("--store", options.store, "slot table (default: beside the machine file, .db)");
  out->add_flag("--json", options.json, "one JSON object");
  auto* const in = app.add_subcommand("import", "what `berth export` wrote, into a folder; overwrites nothing");
  in->callback([&options, &action, file, folder] {
    action = [&options, file, folder] { return run_import(options, *file, *folder); };
  });
  in->add_option("from", *file, "file that berth export wrote")->required()->option_text("FILE");
  in->add_option("folder", *folder, "folder to write into (default: this one)")->option_text("FOLDER");
  in->add_flag("--json", options.json, "one JSON object");
}

}  // namespace

void add_adopt(CLI::App& app, Options& options, std::function<int()>& action) {
  add_adopting(app, options, action);
  add_moving(app, options, action);
}

}  // namespace berth::cli
