/// The slot table of a command.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/design/machine.hpp"
#include "berth/operate/written_files.hpp"
#include "berth/places/slot_store.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// The default place of the slot table of a machine on real ports: beside the machine file, "conveyor.toml" ->
/// "conveyor.db".
[[nodiscard]] std::string default_store(const std::string& machine_file);

class SlotTable {
 public:
  /// Opens `--store`, else the store of a real machine if the command uses one, else one in memory. Two kinds of
  /// command get a copy: a dry run, because it sends what the real run would; and a command that only looks, because
  /// the store belongs to the process that runs the machine or soon will.
  [[nodiscard]] static tl::expected<std::unique_ptr<SlotTable>, Failure> open(const design::Machine& machine,
                                                                              const Options& options);
  ~SlotTable();
  SlotTable(const SlotTable&) = delete;
  SlotTable& operator=(const SlotTable&) = delete;

  [[nodiscard]] places::SlotStore& store() noexcept { return *store_; }
  /// A file beside the slot table: "conveyor.db" -> "conveyor.db.mqtt" for ".mqtt". Empty: it is in memory, or a copy.
  [[nodiscard]] std::string beside(const std::string& ending) const {
    return path_.empty() || !throw_away_.empty() ? std::string() : path_ + ending;
  }
  /// The folder of configurations that SDO clients write to the manager: beside the slot table, "conveyor.db" ->
  /// "conveyor.db-written". For a copy: the folder of the original, which stays unchanged.
  [[nodiscard]] operate::WrittenFiles::Place written(const std::string& machine_file) const;

 private:
  SlotTable() = default;
  [[nodiscard]] tl::expected<std::string, Failure> copied(const std::string& path);
  std::string throw_away_;  // folder of a copied store
  std::string path_;        // of the store, or of the copy's original; empty: in memory
  std::unique_ptr<places::SlotStore> store_;
};

}  // namespace berth::cli
