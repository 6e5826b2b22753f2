#include "berth/device/programming.hpp"

#include "berth/od/cia302.hpp"

namespace berth::device {

std::unique_ptr<Programming> Programming::make(rt::Executor& executor, od::Values& values,
                                               const ProgramOptions& options, TypeCode type, co::NmtSlave& nmt,
                                               co::SdoServers& sdo) {
  const auto& d = values.description();
  const bool programmed = options.memory != nullptr && d.find(od::cia302::program_data) != nullptr &&
                          d.find(od::cia302::program_control) != nullptr;
  return programmed ? std::make_unique<Programming>(executor, values, options, type, nmt, sdo) : nullptr;
}

}  // namespace berth::device
