/// `berth adopt`, `berth export`, `berth import`, `berth scan --bitrate auto`: machines that are there already.
#pragma once

#include <chrono>
#include <string>

#include "options.hpp"

namespace berth::cli {

struct AdoptOptions {
  std::string file;                 ///< the machine file to write
  std::string name = "adopted";     ///< of the machine
  std::uint32_t bitrate = 125'000;  ///< bit/s
  std::chrono::nanoseconds listen{std::chrono::seconds(8)};
  bool passive = false;    ///< sends nothing
  unsigned master = 0;     ///< node-ID of the master that runs it; 0: as far as it can be told
  bool everybody = false;  ///< asks node-IDs that are silent, too
};

/// Exit status: 0 done; 1 no device was found whose place could be written; 3 the port or a file failed.
int run_adopt(const Options& options, const AdoptOptions& adopt);
/// Machine file, the files it names, and the slot table, as one file. Status 1: `to` is there already.
int run_export(const Options& options, const std::string& to);
/// The way back, into a folder. Nothing is overwritten: status 1 names what is there.
int run_import(const Options& options, const std::string& from, const std::string& folder);

/// `berth scan --bitrate auto`: exit status 0 found; 1 undecidable, or the port has no rate; 3 the port failed.
int run_bit_rate(const Options& options);

}  // namespace berth::cli
