#include "fleet_roll_out.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "fleet_host.hpp"
#include "output.hpp"
#include "verbs.hpp"

#if BERTH_MQTT
#include "berth/base/crc.hpp"
#include "berth/eds/context.hpp"
#include "berth/fleet/commands.hpp"
#include "berth/fleet/roll_out.hpp"
#include "berth/fleet/roll_out_journal.hpp"
#include "berth/manager/stored_dcf.hpp"
#endif

namespace berth::cli {
namespace {

struct RollOutOptions {
  FleetConnection connection;
  std::string file;
  std::string slot;
  std::vector<std::string> machines;  // empty: all of the group
  unsigned at_most = 1;
  bool stop_on_failure = false;
  bool yes = false;
  bool dry_run = false;
  std::string journal;  // empty: beside the file
  std::chrono::nanoseconds patience{std::chrono::minutes(5)};
};

#if BERTH_MQTT

using fleet::RollOut;
using sparkplug::EdgeNodeId;
using Json = nlohmann::ordered_json;

// A host sends it in one message, and machines accept 512 KiB.
constexpr std::size_t longest_value = 500 * 1024;

std::string name_of(const EdgeNodeId& id) { return id.group + "/" + id.node; }

// One roll-out from the first look to the last machine.
class RollingOut {
 public:
  RollingOut(const RollOutOptions& how, const Options& options) : how_(how), options_(options) {}

  int run() {
    if (const auto no = read_file()) return tell(*no, options_.json);
    if (const auto no = host_.connect()) return tell(*no, options_.json);
    host_.gather();
    if (const auto no = choose()) return tell(*no, options_.json);
    if (how_.dry_run || !how_.yes) return show_plan();
    auto journal = fleet::RollOutJournal::open(journal_path(), what());
    if (!journal) return tell(failure(Exit::usage, journal.error()), options_.json);
    return carry_out(*journal);
  }

 private:
  std::optional<Failure> read_file() {
    const auto content = eds::read_text_file(how_.file, manager::longest_stored_text);
    if (!content) return failure(Exit::usage, how_.file + ": it cannot be read");
    if (content->empty()) return failure(Exit::usage, how_.file + ": it is empty");
    if (content->size() > manager::longest_stored_text)
      return failure(Exit::usage, how_.file + ": it is longer than 4 MiB");
    value_ = manager::pack_stored(*content);
    if (value_.size() > longest_value)
      return failure(Exit::usage, fmt::format("{}: packed it has {} bytes, and a message holds {}", how_.file,
                                              value_.size(), longest_value));
    const auto extension = std::filesystem::path(how_.file).extension();
    configures_ = manager::is_description(how_.file) || ::strcasecmp(extension.c_str(), ".cdcf") == 0;
    return std::nullopt;
  }

  [[nodiscard]] const char* metric() const { return configures_ ? fleet::configure_metric : fleet::program_metric; }
  [[nodiscard]] const char* command() const { return configures_ ? "configure" : "program download"; }
  [[nodiscard]] fleet::RollOutJournal::What what() const {
    return {.command = command(), .slot = how_.slot, .crc = crc32(value_)};
  }
  [[nodiscard]] std::string journal_path() const {
    return how_.journal.empty() ? how_.file + ".roll-out.jsonl" : how_.journal;
  }

  std::optional<Failure> choose() {
    const auto seen = host_.machines();
    for (const auto& name : how_.machines) {
      const auto machine = machine_named(seen, name);
      // One that is not heard of is named all the same: it fails when its turn comes.
      const auto slash = name.find('/');
      if (!machine && machine.error().status == Exit::usage) return machine.error();
      if (!machine && slash == std::string::npos) return machine.error();
      chosen_.push_back(machine ? machine->id : EdgeNodeId{name.substr(0, slash), name.substr(slash + 1)});
    }
    if (how_.machines.empty()) {
      for (const auto& machine : seen) {
        if (std::ranges::find(machine.slots, how_.slot, &fleet::SlotView::name) != machine.slots.end())
          chosen_.push_back(machine.id);
      }
    }
    std::ranges::sort(chosen_);
    const auto twice = std::ranges::unique(chosen_);
    chosen_.erase(twice.begin(), twice.end());
    if (chosen_.empty()) return failure(Exit::no, "no machine with a slot " + how_.slot + " was heard of");
    return std::nullopt;
  }

  int show_plan() {
    const std::string does =
        configures_ ? "gets this configuration and is restarted to take it" : "is stopped, and gets this program";
    const std::string plan = fmt::format("{}: the device in slot {} of {} machine{} {}, {} at once{}", how_.file,
                                         how_.slot, chosen_.size(), chosen_.size() == 1 ? "" : "s", does, how_.at_most,
                                         how_.stop_on_failure ? "; stops at the first failure" : "");
    if (options_.json) {
      Json json{{"result", "plan"}, {"plan", plan}, {"machines", Json::array()}};
      for (const auto& id : chosen_) json["machines"].push_back(name_of(id));
      print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      print_line(plan);
      for (const auto& id : chosen_) print_line("  " + name_of(id) + obstacle_of(id));
    }
    if (how_.dry_run) return Exit::done;
    print_errors("nothing was sent; confirm it with --yes");
    return Exit::no;
  }

  [[nodiscard]] fleet::RollOutView see(const EdgeNodeId& id) {
    fleet::RollOutView view;
    host_.watch().look([&](const sparkplug::Fleet& fleet) { view = fleet::see(fleet, id, how_.slot, metric()); });
    return view;
  }

  std::string obstacle_of(const EdgeNodeId& id) {
    const auto no = fleet::obstacle(see(id), how_.slot, command());
    return no.empty() ? "" : ": would fail: " + no;
  }

  [[nodiscard]] RollOut::Options roll_out_options() const {
    return {.slot = how_.slot,
            .command = command(),
            .value = fleet::words_of(sparkplug::Value(value_)),
            .at_most = how_.at_most,
            .stop_on_failure = how_.stop_on_failure,
            .patience = std::chrono::duration_cast<RollOut::Time>(how_.patience)};
  }

  int carry_out(fleet::RollOutJournal& journal) {
    std::vector<EdgeNodeId> left;
    for (const auto& id : chosen_) {
      if (std::ranges::find(journal.done(), id) == journal.done().end()) left.push_back(id);
    }
    before_ = chosen_.size() - left.size();
    if (before_ > 0) say(fmt::format("{} of {} have it already, by {}", before_, chosen_.size(), journal.path()));
    RollOut roll_out(roll_out_options(), std::move(left));
    while (!roll_out.over()) {
      for (const auto& id : roll_out.turn([this](const EdgeNodeId& each) { return see(each); }, host_.steady())) {
        const auto sent = host_.watch().write(id, how_.slot, metric(), value_, true);
        roll_out.sent(id, host_.steady(), sent ? "" : describe(sent.error()));
      }
      if (auto no = report(roll_out, journal)) return tell(*no, options_.json);
      if (host_.ended()) {
        if (!std::exchange(stopped_, true)) say("no machine is begun any more; those under way are awaited");
        roll_out.stop();
      }
      host_.rest();
    }
    return conclude(roll_out, journal);
  }

  // Says and keeps what has changed.
  std::optional<Failure> report(const RollOut& roll_out, fleet::RollOutJournal& journal) {
    told_.resize(roll_out.rows().size(), RollOut::Stage::waiting);
    for (std::size_t i = 0; i < told_.size(); ++i) {
      const auto& row = roll_out.rows()[i];
      if (told_[i] == row.stage) continue;
      told_[i] = row.stage;
      const bool ended = row.stage == RollOut::Stage::done || row.stage == RollOut::Stage::failed;
      say(fmt::format("{}: {}{}", name_of(row.machine), words_of(row.stage),
                      row.words.empty() ? "" : ": " + row.words));
      if (!ended) continue;
      const auto problem = journal.add(row.machine, row.stage == RollOut::Stage::done, row.words);
      if (!problem.empty()) return failure(Exit::failed, "the journal cannot be written: " + problem);
    }
    return std::nullopt;
  }

  static const char* words_of(RollOut::Stage stage) {
    switch (stage) {
      case RollOut::Stage::waiting: return "not begun";
      case RollOut::Stage::sent: return "sent";
      case RollOut::Stage::carried_out: return "carried out; waiting until its slot is operational";
      case RollOut::Stage::done: return "done";
      case RollOut::Stage::failed: return "failed";
    }
    return "";
  }

  void say(const std::string& line) const {
    if (!options_.json) print_line(line);
  }

  int conclude(const RollOut& roll_out, const fleet::RollOutJournal& journal) {
    const auto count = [&](RollOut::Stage stage) {
      return static_cast<std::size_t>(std::ranges::count(roll_out.rows(), stage, &RollOut::Row::stage));
    };
    const auto done = before_ + count(RollOut::Stage::done);
    const auto failed = count(RollOut::Stage::failed);
    const auto waiting = count(RollOut::Stage::waiting);
    if (options_.json) {
      Json json{{"done", done}, {"failed", failed}, {"not_begun", waiting}, {"journal", journal.path()}};
      json["machines"] = Json::array();
      for (const auto& row : roll_out.rows()) {
        json["machines"].push_back({{"group", row.machine.group},
                                    {"machine", row.machine.node},
                                    {"result", words_of(row.stage)},
                                    {"reason", row.words}});
      }
      print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      print_line(fmt::format("{} of {} done, {} failed, {} not begun", done, chosen_.size(), failed, waiting));
      if (failed + waiting > 0)
        print_line(fmt::format("the same command goes on with the others ({} says which are done)", journal.path()));
    }
    return failed + waiting == 0 ? Exit::done : Exit::no;
  }

  const RollOutOptions& how_;
  const Options& options_;
  FleetHost host_{how_.connection};
  sparkplug::Bytes value_;
  std::vector<EdgeNodeId> chosen_;
  std::vector<RollOut::Stage> told_;
  std::size_t before_ = 0;
  bool stopped_ = false;
  bool configures_ = false;
};

int run_roll_out(const RollOutOptions& how, const Options& options) { return RollingOut(how, options).run(); }

#else

int run_roll_out(const RollOutOptions&, const Options& options) {
  return tell(failure(Exit::usage, "this berth was built without MQTT (BERTH_MQTT=OFF)"), options.json);
}

#endif

}  // namespace

void add_roll_out(const Verb& fleet, Options& options) {
  const auto how = std::make_shared<RollOutOptions>();
  const Verb verb = fleet.add("roll-out", "one configuration or program for the same slot of several machines",
                              [&options, how] { return run_roll_out(*how, options); });
  verb.word("file", how->file, "a DCF, XDC or concise DCF (.dcf .xdc .cdcf); any other: a program's image")
      .required()
      .shown("FILE");
  verb.word("--slot", how->slot, "the slot of each machine whose device gets it").required().shown("NAME");
  verb.word("--machines", how->machines, "NAME or GROUP/NAME, with commas between (default: all with that slot)")
      .separated_by(',')
      .shown("NAMES");
  verb.word("--group", how->connection.group, "only machines of this group").shown("NAME");
  verb.word("--at-most", how->at_most, "so many machines at once (1 to 1000, default 1)").from_to(1, 1000).shown("N");
  verb.flag("--stop-on-failure", how->stop_on_failure, "begin no machine after one failed");
  verb.time("--timeout", how->patience, "a machine that is not operational by then has failed (default: 5 min)");
  verb.word("--journal", how->journal, "what is done already (default: FILE.roll-out.jsonl)").shown("FILE");
  verb.flag("--dry-run", how->dry_run, "only say what would be done");
  verb.flag("--yes", how->yes, "do it: devices leave operational");
  verb.word("--broker", how->connection.broker, broker_help).shown("URL");
  fleet_connection_words(verb, how->connection);
  json_flag(verb, options);
  verb.footer(
      "Examples:\n  berth fleet roll-out drive-2.dcf --slot drive --dry-run\n"
      "  berth fleet roll-out drive-2.dcf --slot drive --at-most 3 --stop-on-failure");
}

}  // namespace berth::cli
