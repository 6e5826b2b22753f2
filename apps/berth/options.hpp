/// The options of all subcommands, and the exit status.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/request.hpp"

namespace berth::cli {

/// The exit status of every command: success; the answer is no; wrong usage or unreadable input; the bus or a file
/// failed.
enum Exit : int { done = 0, no = 1, usage = 2, failed = 3 };

/// Berth as a master, alone or among others.
struct MasterOptions {
  bool beside_another = false;       ///< allows a first start even beside a possible other master
  bool takes_part = false;           ///< otherwise a bus is refused while another master is active on it
  std::optional<unsigned> id;        ///< instead of the machine file's
  std::optional<unsigned> priority;  ///< the same
  std::string ready;                 ///< "", "operational", "started": when a service manager hears so
  std::string on_exit;               ///< "", "leave", "preop", "stop": what the devices get when the run ends
};

/// CiA 309-3 beside the main job.
struct Cia309 {
  std::string where;      ///< HOST:PORT; empty: not offered
  bool commands = false;  ///< clients may command a real machine
  bool anywhere = false;  ///< `where` may be an address that other computers can reach
};

/// Pages for a browser beside the main job.
struct StudioOptions {
  std::string where;  ///< HOST:PORT; "true": 127.0.0.1 and the first free port from 8302; empty: not offered
  std::vector<std::string> roles;  ///< roles whose addresses are printed too
  std::string tokens;              ///< file that keeps the tokens; empty: new ones at each start
  std::string certificate;         ///< file; with `key`: TLS
  std::string key;
  bool open_metrics = false;  ///< GET /metrics needs no token
  [[nodiscard]] bool has_doors() const noexcept {
    return !roles.empty() || !tokens.empty() || !certificate.empty() || !key.empty() || open_metrics;
  }
  [[nodiscard]] bool offered() const noexcept { return !where.empty(); }
  [[nodiscard]] bool named() const noexcept { return offered() && where != "true"; }
};

/// Servers beside the main job.
struct Offers {
  Cia309 gateway;
  StudioOptions studio;
  std::string mqtt;      ///< address of a broker, instead of the machine file's; empty: the file's
  bool no_mqtt = false;  ///< not even the file's
};

/// A plant file in place of ports, and how its world runs.
struct SimulationOptions {
  std::string plant;  ///< the file; empty: none
  std::string state;  ///< file that keeps what the simulated devices remember
  std::optional<std::uint64_t> seed;
  bool pace = false;
  bool fast = false;
};

/// The store of the slot table.
struct StoreOptions {
  std::string file;   ///< empty: in memory on a simulated bus
  bool used = true;   ///< the command uses a store
  bool made = false;  ///< on a real machine the command makes the store if there is none
};

/// Files beside the machine's own.
struct FileOptions {
  std::string record;                      ///< candump log of every frame; empty: none
  bool force = false;                      ///< existing files are replaced
  std::vector<std::string> allow_outside;  ///< folders besides their own in which the machine's files may name files
};

/// Limits on what is sent on ports outside this process.
struct OutsideOptions {
  bool observe = false;    ///< sends nothing, and locks no port
  bool read_only = false;  ///< sends SDO upload requests only
};

/// For commands that are one request.
struct SingleOptions {
  bool bring_up = false;                          ///< runs the main job first
  std::optional<std::chrono::nanoseconds> watch;  ///< repeats it with this period
};

/// Which events of a run are printed.
struct EventOptions {
  bool none = false;   ///< only how the run ends
  bool lines = false;  ///< --json: each as a line as it happens
  std::string level;   ///< none that is less urgent (`log_levels`); empty: all
};

struct Options {
  bool json = false;
  bool dry_run = false;
  bool yes = false;  ///< confirms without asking
  OutsideOptions outside;
  StoreOptions store;
  MasterOptions master;
  std::string machine;
  FileOptions files;
  std::string bus;
  std::vector<std::string> ports;    ///< "socketcan:can0" or "BUS=socketcan:can0": replaces the machine file's
  std::optional<unsigned> bit_rate;  ///< of the only port, if no machine file gives it
  std::vector<std::string> eds;      ///< "FILE" or "NODE=FILE": descriptions of devices in no slot
  SimulationOptions sim;
  std::string control;  ///< empty: command::control_path of the machine
  Offers offers;
  std::optional<std::chrono::nanoseconds> timeout;
  std::string until;  ///< "", "operational", "replaced"
  EventOptions events;
  SingleOptions single;
  int real_time = 0;  ///< SCHED_FIFO priority; 0: none
};

}  // namespace berth::cli
