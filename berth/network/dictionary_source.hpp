/// A slave's configuration and program, from the object dictionary of its master
/// (`berth/manager/dictionary_rules.hpp`).
#pragma once

#include "berth/manager/dictionary_rules.hpp"
#include "berth/manager/program_transfers.hpp"
#include "berth/network/boot_slave.hpp"

namespace berth::network {

/// Configures the slave: factory settings (bit 7 of 1F81h and 1F8Ah), then the differences, read back, dated and saved
/// (`Configurator`). A slave without memory is configured at every boot. If vendor-ID or product code of the DCF
/// differs from the slave's: Errc::mismatch, and nothing is written.
class DictionarySource final : public BootSource {
 public:
  /// `values` must stay; it is read at each boot-up.
  DictionarySource(const od::Values& values, NodeId node) noexcept : values_(&values), node_(node) {}
  /// Bits 2 and 3 of 1F81h.
  void renew(manager::SlaveRules& rules) const noexcept override;
  rt::Task<Result<void>> configure(BootTarget& target, manager::SlaveRules& rules) override;
  /// Downloads the program of 1F58h (`ProgramLoader`).
  rt::Task<Result<void>> update(BootTarget& target, const manager::SlaveRules& rules) override;
  /// The sources of all slaves on a bus share it; null: not shared. Must stay.
  void share(manager::ProgramTransfers* transfers) noexcept { transfers_ = transfers; }

 private:
  rt::Task<Result<void>> is_for(BootTarget& target, TypeCode type);
  rt::Task<Result<void>> restore(BootTarget& target, std::uint8_t sub);

  const od::Values* values_;
  NodeId node_;
  manager::ProgramTransfers* transfers_ = nullptr;
};

}  // namespace berth::network
