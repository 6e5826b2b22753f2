// The words and options of `berth adopt`, `berth export` and `berth import`.
#include <memory>

#include "adopt.hpp"
#include "verbs.hpp"

namespace berth::cli {

void add_adopt(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<AdoptOptions>();
  const Verb adopt =
      berth.add("adopt", "write the machine file and bindings of a running machine without disturbing it",
                [&options, wanted] { return run_adopt(options, *wanted); });
  adopt.word("file", wanted->file, "machine file to write").required().shown("MACHINE");
  adopt.word("--port", options.ports, "port of the bus").required().shown("PORT").values(1, 1);
  adopt.word("--bitrate", wanted->bitrate, "bit/s (default 125000)")
      .one_of(std::vector<std::uint32_t>{10'000, 20'000, 50'000, 125'000, 250'000, 500'000, 800'000, 1'000'000})
      .shown("BIT/S");
  adopt.word("--bus", options.bus, "its name in the machine file (default: field)").shown("NAME");
  adopt.word("--name", wanted->name, "name of the machine (default: adopted)").shown("NAME");
  adopt.word("--store", options.store.file, "slot table to write (default: beside the machine file, .db)")
      .shown("FILE");
  adopt.time("--for", wanted->listen, "how long to listen (default: 8 s)");
  const Word passive = adopt.flag("--passive", wanted->passive, "send nothing; report only what is heard");
  adopt.flag("--all", wanted->everybody, "ask silent node-IDs, too").excludes(passive);
  adopt.word("--master", wanted->master, "node-ID of the master that runs it: it gets no slot")
      .from_to(1, 127)
      .shown("NODE");
  json_flag(adopt, options);
  adopt.footer(
      "Sends SDO upload requests (1000h, 1018h, 1008h to 100Ah) and nothing else; a\n"
      "node that another SDO client talks to is left alone.\nExample:\n  berth adopt conveyor.toml --port can0 "
      "--bitrate 250000");
}

void add_export(Verb& berth, Options& options) {
  const auto to = std::make_shared<std::string>();
  const Verb out = berth.add("export", "machine file, the files it names and its slot table as one file",
                             [&options, to] { return run_export(options, *to); });
  machine_option(out, options);
  out.word("file", *to, "file to write").required().shown("FILE");
  out.word("--store", options.store.file, "slot table (default: beside the machine file, .db)").shown("FILE");
  json_flag(out, options);
  out.footer("Examples:\n  berth export conveyor.export\n  berth export conveyor.toml conveyor.export");
}

void add_import(Verb& berth, Options& options) {
  const auto from = std::make_shared<std::string>();
  const auto folder = std::make_shared<std::string>();
  const Verb in = berth.add("import", "what `berth export` wrote, into a folder; overwrites nothing",
                            [&options, from, folder] { return run_import(options, *from, *folder); });
  in.word("from", *from, "file that berth export wrote").required().shown("FILE");
  in.word("folder", *folder, "folder to write into (default: this one)").shown("FOLDER");
  json_flag(in, options);
  in.footer("Example:\n  berth import conveyor.export spare-computer");
}

}  // namespace berth::cli
