/// `berth adopt`, `berth export`, `berth import`, `berth scan --bitrate auto`: for machines that exist already.
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
  unsigned master = 0;     ///< node-ID of the master that runs it; 0: detect it
  bool everybody = false;  ///< also asks node-IDs that are silent
};

/// Exit status: 0 done; 1 no slot could be written for any device; 3 the port or a file failed.
int run_adopt(const Options& options, const AdoptOptions& adopt);
/// Puts the machine file, the files it names, and the slot table into one file. Status 1: `to` exists.
int run_export(const Options& options, const std::string& to);
/// Unpacks an export into a folder. Overwrites nothing: status 1 names what exists.
int run_import(const Options& options, const std::string& from, const std::string& folder);

/// `berth scan --bitrate auto`: exit status 0 found; 1 undecidable, or the port has no bit rate; 3 the port failed.
int run_bit_rate(const Options& options);

}  // namespace berth::cli
