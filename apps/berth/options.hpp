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
  bool takes_part = false;           ///< else such a bus is refused while another is active
  std::optional<unsigned> id;        ///< instead of the machine file's
  std::optional<unsigned> priority;  ///< the same
  std::string on_exit;               ///< "", "leave", "preop", "stop": to the devices when it ends
};

/// CiA 309-3 beside the main job.
struct Cia309 {
  std::string where;      ///< HOST:PORT; empty: not offered
  bool commands = false;  ///< its clients may command a real machine
};

struct Options {
  bool json = false;
  bool dry_run = false;
  bool yes = false;          ///< a person confirms what is asked for
  bool observe = false;      ///< sends nothing on ports outside this process, and owns none of them
  bool read_only = false;    ///< sends SDO upload requests there, and nothing else
  bool slot_table = true;    ///< the command uses the store
  bool makes_store = false;  ///< and makes it on a real machine when there is none
  MasterOptions master;
  std::string machine;
  std::string bus;
  std::vector<std::string> ports;    ///< "socketcan:can0" or "BUS=socketcan:can0": instead of the machine file's
  std::optional<unsigned> bit_rate;  ///< of the one port, where no machine file says it
  std::vector<std::string> eds;      ///< "FILE" or "NODE=FILE": what devices are like that are in no slot
  std::string sim;                   ///< plant file
  std::string state;                 ///< file that keeps what the simulated devices remember
  std::string store;                 ///< empty: in memory on a simulated bus
  std::string control;               ///< empty: command::control_path of the machine
  std::string record;                ///< candump log of every frame
  Cia309 gateway;
  std::optional<std::uint64_t> seed;
  std::optional<std::chrono::nanoseconds> timeout;
  std::string until;  ///< "", "operational", "replaced"
  bool pace = false;
  bool fast = false;
  bool events = false;                            ///< --json: every event as a line, as it happens
  bool bring_up = false;                          ///< single commands: run the main job first
  std::optional<std::chrono::nanoseconds> watch;  ///< single commands: again and again, so far apart
  int real_time = 0;                              ///< SCHED_FIFO priority; 0: none
};

}  // namespace berth::cli
