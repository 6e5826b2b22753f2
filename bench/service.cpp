// Berth as a service: what `berth up` costs while a machine of 120 devices runs and nothing happens, and whether memory
// and descriptors stay as they are over a simulated week in which something fails each day.
//
// The devices are a process of their own, reached by socketcand on loopback; `bench_service IFACE` reaches them by this
// CAN interface, such as vcan0, where the kernel has it.
#include <fmt/format.h>
#include <malloc.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "bench/tools/child.hpp"
#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/store/database.hpp"
#include "berth/tree/session.hpp"

using namespace berth;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

namespace {

constexpr double cpu_aim_percent = 1;
constexpr double memory_aim_mib = 25;
constexpr auto settling = 5s;
constexpr auto watched = 30s;

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "bench service: %s\n", what.c_str());
  std::exit(3);
}

class Folder {
 public:
  Folder() {
    auto pattern = (fs::temp_directory_path() / "berth-bench-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) give_up("no folder in " + fs::temp_directory_path().string());
    path_ = pattern;
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string file(const char* name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

/// The socket of a service manager (sd_notify(3)), for processes that are started after it.
class ServiceManager {
 public:
  explicit ServiceManager(const std::string& path) : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the interface of sockets
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) give_up("no socket " + path);
    const timeval patience{600, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);  // NOLINT(concurrency-mt-unsafe): there is one thread
  }
  ~ServiceManager() {
    ::unsetenv("NOTIFY_SOCKET");  // NOLINT(concurrency-mt-unsafe)
    ::close(socket_);
  }
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  void wait_until_ready() const {
    for (;;) {
      std::array<char, 4096> text{};
      const auto length = ::recv(socket_, text.data(), text.size(), 0);
      if (length < 0) give_up("the machine was not ready within ten minutes");
      if (std::string_view(text.data(), static_cast<std::size_t>(length)).find("READY=1") != std::string_view::npos)
        return;
    }
  }

 private:
  int socket_;
};

std::string example(const char* name) { return std::string(BERTH_SOURCE_DIR "/examples/") + name; }

std::unique_ptr<bench::Child> started(std::vector<std::string> words) {
  words.insert(words.begin(), BERTH_BINARY);
  return std::make_unique<bench::Child>(words, true);
}

/// The 120 devices, and the port by which they are reached.
struct Devices {
  std::unique_ptr<bench::Child> process;
  std::string port;
};

Devices devices_at(const std::string& interface) {
  const auto plant = example("hundred-twenty.plant.toml"), machine = example("hundred-twenty.toml");
  if (!interface.empty()) {
    return {started({"device", plant, "--port", "field=socketcan:" + interface}), "socketcan:" + interface};
  }
  auto process = started({"serve", plant, "-m", machine, "--listen", "127.0.0.1:0", "--json"});
  const auto line = process->hear(60s);
  const auto said = nlohmann::json::parse(line.value_or(""), nullptr, false);
  if (!said.is_object() || !said.contains("listening")) give_up("berth serve does not say where it listens");
  return {std::move(process), fmt::format("socketcand://{}/field", said["listening"].get<std::string>())};
}

/// `berth up` with a service manager, and its log read, as a journal does.
class Service {
 public:
  Service(const Folder& folder, const std::string& port)
      : manager_(folder.file("notify")),
        up_(started({"up", example("hundred-twenty.toml"), "--port", port, "--yes", "--store", folder.file("store.db"),
                     "--color", "never"})),
        reads_the_log_([this](const std::stop_token& ended) {
          while (!ended.stop_requested()) static_cast<void>(up_->hear(100ms));
        }) {}
  ~Service() {
    reads_the_log_ = {};
    up_->end(SIGTERM);
  }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// The seconds from its start.
  [[nodiscard]] double ready() const {
    manager_.wait_until_ready();
    return start_.seconds();
  }
  [[nodiscard]] const bench::Child& process() const { return *up_; }

 private:
  const bench::Watch start_;
  const ServiceManager manager_;
  const std::unique_ptr<bench::Child> up_;
  std::jthread reads_the_log_;
};

void idle(const std::string& interface) {
  const Folder folder;
  const auto devices = devices_at(interface);
  const double blank = Service(folder, devices.port).ready();
  fs::remove(folder.file("notify"));
  const Service service(folder, devices.port);
  const double known = service.ready();
  std::this_thread::sleep_for(settling);
  const double before = service.process().cpu_seconds();
  const bench::Watch watch;
  std::this_thread::sleep_for(watched);
  const double share = 100 * (service.process().cpu_seconds() - before) / watch.seconds();
  const std::vector<bench::Figure> rows{
      {"from its start to READY=1, blank devices", fmt::format("{:.1f} s", blank)},
      {"from its next start to READY=1, the same devices", fmt::format("{:.1f} s", known)},
      bench::at_most(fmt::format("processor time, all operational, {} s", watched.count()), share, cpu_aim_percent,
                     "%"),
      bench::at_most("peak resident memory", service.process().peak_mib(), memory_aim_mib, "MiB"),
  };
  bench::print_figures(
      fmt::format("berth up as a service, 120 devices at {}", interface.empty() ? "socketcand on loopback" : interface),
      rows);
}

// ---- the week ----

using bench::bus_name;
constexpr unsigned slots = 30;
constexpr unsigned days = 7;
constexpr std::uint32_t bit_rate = 250'000;

design::Machine week_machine() {
  auto machine = bench::machine_of(slots, bit_rate);
  for (auto& slot : machine.slots) slot.spec.replacement = places::Replacement::automatic;
  return machine;
}

/// A device for each slot, and one more for each day.
plant::PlantFile week_plant() {
  auto plant = bench::plant_of(slots + days, false, 500us);
  for (auto& device : plant.devices) {
    device.response.max = 2ms;
    device.plugged = device.address.serial <= slots;
  }
  return plant;
}

/// What the process holds.
struct Holds {
  double heap_kib;
  double resident_mib;
  std::size_t descriptors;
};

Holds holds() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident = 0;
  statm >> pages >> resident;
  return {static_cast<double>(::mallinfo2().uordblks) / 1024,
          resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1024 / 1024,
          static_cast<std::size_t>(std::distance(fs::directory_iterator("/proc/self/fd"), {}))};
}

class Week {
 public:
  explicit Week(plant::World& world, tree::Session& session) : world_(&world), session_(&session) {}

  /// A device without power for ten minutes; one whose firmware restarts; one replaced by a new one; the power of all,
  /// for half a minute; an hour of a device that answers late.
  void run_day(unsigned day) {
    auto& sim = world_->sim();
    sim.run_for(3h);
    device(10 + day).power(false);
    sim.run_for(10min);
    device(10 + day).power(true);
    must_run("after a device was without power");
    device(20 + day).reset();
    must_run("after a reset");
    sim.run_for(5h);
    device(1 + day).unplug();
    sim.run_for(2min);
    device(slots + 1 + day).plug();
    must_run("after a replacement");
    device(25).slow(20ms, 1h);
    sim.run_for(4h);
    for (unsigned n = 1; n <= slots + days; ++n) device(n).power(false);
    sim.run_for(30s);
    for (unsigned n = 1; n <= slots + days; ++n) device(n).power(true);
    must_run("after a power failure of all");
    sim.run_until(rt::Time{} + (day + 1) * 24h);
  }

 private:
  plant::SimDevice& device(unsigned number) { return *world_->find(fmt::format("d{}", number)); }
  void must_run(const char* when) {
    world_->sim().run_for(1min);
    if (!session_->operational()) give_up(fmt::format("not operational a minute {}", when));
  }

  plant::World* world_;
  tree::Session* session_;
};

void week() {
  const Folder folder;
  const auto machine = week_machine();
  auto store = store::Database::open(folder.file("week.db"), {.sync = false});
  if (!store) give_up(store.error().message);
  const auto world = bench::start(week_plant(), bit_rate);
  const auto port = world->attach_master(bus_name);
  tree::Session session(world->executor(), machine, **store);
  if (!session.connect(bus_name, *port) || !session.open()) give_up("no session");
  session.start();
  world->sim().run_for(5min);
  if (!session.operational()) give_up("it does not become operational");
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](std::string day, const bench::Watch& watch) {
    const auto now = holds();
    const auto frames = world->bus(bus_name)->statistics().frames;
    rows.push_back({std::move(day), bench::grouped(now.heap_kib), fmt::format("{:.1f}", now.resident_mib),
                    fmt::format("{}", now.descriptors), bench::grouped(static_cast<double>(frames)),
                    fmt::format("{:.0f} s", watch.seconds())});
  };
  add("start", {});
  Week runs(*world, session);
  for (unsigned day = 0; day < days; ++day) {
    const bench::Watch watch;
    runs.run_day(day);
    add(fmt::format("day {}", day + 1), watch);
  }
  bench::print_columns(
      "A simulated week, 30 devices at 250 kbit/s; each day a device off, a reset, a replacement, a slow "
      "one, and a power failure of all",
      {"", "heap KiB", "resident MiB", "descriptors", "frames so far", "took"}, rows);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string interface = argc > 1 ? argv[1] : "";
  idle(interface);
  if (interface.empty()) week();
  return 0;
}
