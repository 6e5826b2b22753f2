/// The flags that every subcommand has, and the exit status.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/request.hpp"

namespace berth::cli {

/// The exit status of every command: done, the answer is no, wrong usage or unreadable input, the bus or a file failed.
enum Exit : int { done = 0, no = 1, usage = 2, failed = 3 };

/// What Berth is as master, alone or among others.
struct MasterOptions {
  bool beside_another = false;       ///< a first start also beside what may be another master
  bool takes_part = false;           ///< else such a bus is refused while another is active
  std::optional<unsigned> id;        ///< instead of the machine file's
  std::optional<unsigned> priority;  ///< the same
  std::string on_exit;               ///< "", "leave", "preop", "stop": to the devices when it ends
};

/// CiA 309-3 beside the main job.
struct Cia309 {
  std::string where;      ///< HOST:PORT; empty: not offered
  bool commands = false;  ///< its clients may command a real machine
  bool anywhere = false;  ///< `where` may be an address that other computers reach
};

/// Pages for a browser beside the main job.
struct StudioOptions {
  std::string where;  ///< HOST:PORT; "true": 127.0.0.1 and the first free port from 8302; empty: not offered
  std::vector<std::string> roles;  ///< whose addresses are printed, too
  std::string tokens;              ///< file that keeps the tokens; empty: new ones for each start
  std::string certificate;         ///< file; with `key`: TLS
  std::string key;
  [[nodiscard]] bool has_doors() const noexcept {
    return !roles.empty() || !tokens.empty() || !certificate.empty() || !key.empty();
  }
  [[nodiscard]] bool offered() const noexcept { return !where.empty(); }
  [[nodiscard]] bool named() const noexcept { return offered() && where != "true"; }
};

/// What is offered to others beside the main job.
struct Offers {
  Cia309 gateway;
  StudioOptions studio;
};

/// A plant file instead of ports, and how its world runs.
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
  bool used = true;   ///< by the command
  bool made = false;  ///< by the command, on a real machine when there is none
};

/// Files beside the machine's own.
struct FileOptions {
  std::string record;                      ///< candump log of every frame; empty: none
  bool force = false;                      ///< those that are there are replaced
  std::vector<std::string> allow_outside;  ///< folders that the machine's files may name files in, beside their own
};

/// What is not sent on ports outside this process.
struct OutsideOptions {
  bool observe = false;    ///< nothing is sent there, and none of them owned
  bool read_only = false;  ///< only SDO upload requests are
};

/// Commands that are one request.
struct SingleOptions {
  bool bring_up = false;                          ///< the main job runs first
  std::optional<std::chrono::nanoseconds> watch;  ///< again and again, so far apart
};

/// Which events of a run are printed.
struct EventOptions {
  bool none = false;   ///< only how it ends
  bool lines = false;  ///< --json: each as a line, as it happens
};

struct Options {
  bool json = false;
  bool dry_run = false;
  bool yes = false;  ///< a person confirms what is asked for
  OutsideOptions outside;
  StoreOptions store;
  MasterOptions master;
  std::string machine;
  FileOptions files;
  std::string bus;
  std::vector<std::string> ports;    ///< "socketcan:can0" or "BUS=socketcan:can0": instead of the machine file's
  std::optional<unsigned> bit_rate;  ///< of the one port, where no machine file says it
  std::vector<std::string> eds;      ///< "FILE" or "NODE=FILE": what devices are like that are in no slot
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
