/// The slot table that a command works on.
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

/// Where the slot table of a machine on real ports is when it is not said: beside the machine file,
/// "conveyor.toml" -> "conveyor.db".
[[nodiscard]] std::string default_store(const std::string& machine_file);

class SlotTable {
 public:
  /// `--store`, else that of a real machine when the command uses one, else in memory. A dry run and a command that
  /// only looks get a copy: the first sends what the real one would, and for the second the store belongs to the
  /// process that runs the machine, or is about to.
  [[nodiscard]] static tl::expected<std::unique_ptr<SlotTable>, Failure> open(const design::Machine& machine,
                                                                              const Options& options);
  ~SlotTable();
  SlotTable(const SlotTable&) = delete;
  SlotTable& operator=(const SlotTable&) = delete;

  [[nodiscard]] places::SlotStore& store() noexcept { return *store_; }
  /// Where configurations are kept that SDO clients write to the manager: a folder beside the slot table, "conveyor.db"
  /// -> "conveyor.db-written". Of a copy, that of the slot table itself, which is left as it is.
  [[nodiscard]] operate::WrittenFiles::Place written(const std::string& machine_file) const;

 private:
  SlotTable() = default;
  [[nodiscard]] tl::expected<std::string, Failure> copied(const std::string& path);
  std::string throw_away_;  // folder of a copied store
  std::string path_;        // of the store, or of what was copied; empty: it is in memory
  std::unique_ptr<places::SlotStore> store_;
};

}  // namespace berth::cli
