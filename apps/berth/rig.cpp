#include "rig.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "berth/io/plant_port.hpp"
#include "berth/store/database.hpp"
#include "berth/text/file.hpp"
#include "up.hpp"

namespace berth::cli {

namespace fs = std::filesystem;

/// Sees every frame of one bus.
class Rig::BusTap final : public can::Tap {
 public:
  BusTap(Rig& rig, sim::Bus& bus, int master) : rig_(&rig), bus_(&bus), master_(master) { bus_->add_tap(*this); }
  ~BusTap() { bus_->remove_tap(*this); }
  BusTap(const BusTap&) = delete;
  BusTap& operator=(const BusTap&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    rig_->recorded({operate::seconds(at), bus_->name(), can::to_string(frame), sender == master_});
  }

 private:
  Rig* rig_;
  sim::Bus* bus_;
  int master_;
};

Rig::Made Rig::make(const Options& options, const Sources& sources) {
  std::unique_ptr<Rig> rig(new Rig);
  if (auto good = rig->read(options, sources); !good) return tl::unexpected(good.error());
  if (auto good = rig->build_world(options); !good) return tl::unexpected(good.error());
  if (auto good = rig->open_store(options); !good) return tl::unexpected(good.error());
  if (auto good = rig->open_session(options); !good) return tl::unexpected(good.error());
  return rig;
}

Rig::~Rig() {
  session_.reset();
  store_.reset();
  if (log_ != nullptr) std::fclose(log_);
  std::error_code ignored;
  if (!throw_away_.empty()) fs::remove_all(throw_away_, ignored);
}

namespace {

void warn(const Findings& findings, bool json) {
  for (const auto& f : findings) {
    if (f.severity == Finding::Severity::warning && !json) print_error(to_string(f));
  }
}

bool in_another_process(const design::Machine& machine) noexcept {
  return std::ranges::all_of(machine.buses, [](const auto& b) { return b.port.kind == design::PortKind::plant; });
}

}  // namespace

tl::expected<void, Failure> Rig::read(const Options& options, const Sources& sources) {
  auto machine = sources.machine_text.empty()
                     ? design::load_machine(sources.machine_name)
                     : design::read_machine(sources.machine_text, sources.machine_name, design::eds_loader());
  Findings findings = machine.findings;
  const bool file_named = !sources.plant_name.empty() || !sources.plant_text.empty();
  if (machine.machine && !file_named && in_another_process(*machine.machine)) {
    warn(findings, options.json);
    machine_ = std::move(*machine.machine);
    elsewhere_ = true;
    if (!options.dry_run && !options.fast && options.record.empty()) return {};
    return tl::unexpected(
        failure(Exit::usage, "--dry-run, --fast and --record need a world of this process: give --sim PLANT"));
  }
  if (machine.machine && sources.plant_name.empty()) {
    for (const auto& bus : machine.machine->buses) {
      if (bus.port.kind == design::PortKind::sim) continue;
      return tl::unexpected(failure(
          Exit::failed, fmt::format("{}:{}: bus {}: this Berth has no port {} yet; real ports come "
                                    "with a later version: give --sim PLANT to run the machine "
                                    "on a simulated bus",
                                    machine.machine->file, bus.place.line, bus.name, can::to_string(bus.port))));
    }
    return tl::unexpected(
        failure(Exit::usage, "the machine's buses are simulated: give the plant file with --sim PLANT"));
  }
  auto plant = sources.plant_text.empty() ? plant::load_plant(sources.plant_name)
                                          : plant::read_plant(sources.plant_text, sources.plant_name);
  findings.insert(findings.end(), plant.findings.begin(), plant.findings.end());
  if (!machine.machine || !plant.plant) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  machine_ = std::move(*machine.machine);
  plant_ = std::move(*plant.plant);
  if (options.seed) plant_.seed = *options.seed;
  if (!options.bus.empty() && machine_.bus(options.bus) == nullptr) {
    std::string names;
    for (const auto& bus : machine_.buses) names += (names.empty() ? "" : ", ") + bus.name;
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{}: there is no bus \"{}\"; use {}", machine_.file, options.bus, names)));
  }
  return {};
}

tl::expected<void, Failure> Rig::build_world(const Options& options) {
  std::vector<plant::BusRate> rates;
  for (const auto& bus : machine_.buses) {
    if (!elsewhere_) rates.push_back({bus.name, bus.bitrate});
  }
  Findings findings;
  world_ = plant::World::make(plant_, rates, findings);
  for (auto& finding : findings) {
    if (finding.file.empty()) finding.file = options.sim;
  }
  if (!world_) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  if (elsewhere_) loop_ = std::make_unique<io::Loop>(world_->executor());
  if (options.state.empty()) return {};
  Result<void> kept;
  if (!options.dry_run) {
    kept = world_->keep_state(options.state);
  } else if (fs::exists(options.state)) {
    Findings unreadable;
    const auto text = text::read_file(options.state, unreadable);
    if (!text) return tl::unexpected(failure(unreadable));
    kept = world_->restore(*text);
  }
  if (kept) return {};
  return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", options.state, describe(kept.error()))));
}

// A dry run works on a copy of the store, so that it sends what the real one would.
tl::expected<void, Failure> Rig::open_store(const Options& options) {
  std::string path = options.store;
  if (options.dry_run && !path.empty()) {
    if (fs::exists(path)) {
      std::string pattern = (fs::temp_directory_path() / "berth-dry-run-XXXXXX").string();
      if (::mkdtemp(pattern.data()) == nullptr)
        return tl::unexpected(failure(Exit::failed, pattern + ": " + std::strerror(errno)));
      throw_away_ = pattern;
      const fs::path copy = fs::path(throw_away_) / "store.db";
      std::error_code error;
      fs::copy_file(path, copy, error);
      if (!error && fs::exists(path + "-wal")) fs::copy_file(path + "-wal", copy.string() + "-wal", error);
      if (error) return tl::unexpected(failure(Exit::failed, path + ": " + error.message()));
      path = copy.string();
    } else {
      path.clear();
    }
  }
  if (path.empty()) {
    store_ = std::make_unique<places::MemoryStore>();
    return {};
  }
  auto opened = store::Database::open(path);
  if (!opened) return tl::unexpected(failure(Exit::failed, opened.error().message));
  store_ = std::move(*opened);
  return {};
}

// Berth's own node on one bus.
tl::expected<std::unique_ptr<can::Port>, Failure> Rig::attach(const design::Bus& bus, const Options& options) {
  if (loop_) {
    auto port = io::PlantPort::connect(*loop_, bus.port.address, bus.name);
    if (!port) return tl::unexpected(failure(Exit::failed, port.error()));
    const auto rate = (*port)->status().bit_rate;
    if (rate == bus.bitrate) return std::unique_ptr<can::Port>(std::move(*port));
    return tl::unexpected(
        failure(Exit::failed, fmt::format("{}:{}: bus {} is told to run at {} bit/s, and the plant's "
                                          "runs at {}",
                                          machine_.file, bus.place.line, bus.name, bus.bitrate, rate)));
  }
  auto port = world_->attach_master(bus.name);
  if (!port)
    return tl::unexpected(failure(Exit::failed, fmt::format("the simulated world has no bus \"{}\"", bus.name)));
  if (options.dry_run || !options.record.empty()) {
    taps_.push_back(std::make_unique<BusTap>(*this, *world_->bus(bus.name), port->number()));
  }
  return std::unique_ptr<can::Port>(std::move(port));
}

tl::expected<void, Failure> Rig::open_session(const Options& options) {
  session_ = std::make_unique<operate::Session>(world_->executor(), machine_, *store_);
  for (const auto& bus : machine_.buses) {
    auto port = attach(bus, options);
    if (!port) return tl::unexpected(port.error());
    const auto connected = session_->connect(bus.name, **port);
    if (!connected) return tl::unexpected(failure(Exit::failed, describe(connected.error())));
    ports_.push_back(std::move(*port));
  }
  if (!options.record.empty()) {
    log_ = std::fopen(options.record.c_str(), "we");
    if (log_ == nullptr) return tl::unexpected(failure(Exit::failed, options.record + ": " + std::strerror(errno)));
  }
  const auto opened = session_->open();
  if (opened) return {};
  return tl::unexpected(failure(Exit::failed, "the slot table cannot be read: " + describe(opened.error())));
}

// candump's log format.
void Rig::recorded(const Recorded& frame) {
  if (log_ != nullptr) {
    const std::string line = candump_line(frame) + '\n';
    log_failed_ = log_failed_ || std::fwrite(line.data(), 1, line.size(), log_) != line.size();
  }
  if (sent_ != nullptr && frame.by_master) sent_->push_back(frame);
}

}  // namespace berth::cli
