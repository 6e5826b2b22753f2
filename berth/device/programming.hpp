/// Connects a device's programs to the device: NMT reset node restarts them, the SDO servers answer for them.
#pragma once

#include <memory>

#include "berth/co/nmt_slave.hpp"
#include "berth/co/sdo_servers.hpp"
#include "berth/device/programs.hpp"

namespace berth::device {

class Programming final : private Programs::Owner {
 public:
  /// Null when `options` has no memory for programs, or the dictionary lacks 1F50h or 1F51h. All must outlive it.
  [[nodiscard]] static std::unique_ptr<Programming> make(rt::Executor& executor, od::Values& values,
                                                         const ProgramOptions& options, TypeCode type,
                                                         co::NmtSlave& nmt, co::SdoServers& sdo);
  Programming(rt::Executor& executor, od::Values& values, const ProgramOptions& options, TypeCode type,
              co::NmtSlave& nmt, co::SdoServers& sdo)
      : nmt_(&nmt), sdo_(&sdo), programs_(executor, values, options, type, static_cast<Programs::Owner&>(*this)) {}

  [[nodiscard]] Programs& programs() noexcept { return programs_; }
  [[nodiscard]] const Programs& programs() const noexcept { return programs_; }

 private:
  void restart() noexcept override { nmt_->apply(co::NmtCommand::reset_node); }
  void answer(ObjectRef object, od::AbortCode code) noexcept override { sdo_->complete(object, code); }

  co::NmtSlave* nmt_;
  co::SdoServers* sdo_;
  Programs programs_;
};

}  // namespace berth::device
