/// The other way round: the configuration that a live device has, as a DCF (CiA 306-1 §5), so that the device that
/// replaces it gets the same. CiA 302-3 keeps it in 1F20h of the manager.
#pragma once

#include <string>
#include <vector>

#include "berth/co/sdo_access.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/rt/task.hpp"

namespace berth::manager {

/// Is it configuration? It can be read and written, is no register, command, clock or program (`Configuration` leaves
/// the same out), no DOMAIN, no process output (access rww), and its description lets a scan read it (ObjFlags bit 1).
[[nodiscard]] bool is_setting(const od::Object& object, const od::SubObject& sub) noexcept;

/// A DCF of what `eds` describes with these values. What a file cannot carry (a text with line breaks) goes to
/// `left_out`. Errors: as `eds::make_dcf` has them.
[[nodiscard]] Result<std::string> make_dcf_text(const eds::File& eds, eds::Configuration configuration,
                                                std::vector<ObjectRef>& left_out);

/// 1021h, the EDS that the device itself has (1022h: its format). Errors: Errc::not_found it has none;
/// Errc::unsupported the format is not that of CiA 301, plain text; those of SDO.
[[nodiscard]] rt::Task<Result<std::string>> read_own_eds(co::SdoAccess& device);

struct UploadedConfiguration {
  std::string dcf;
  std::size_t read = 0;             ///< values in it
  std::size_t refused = 0;          ///< described, and not there, or not readable now
  std::vector<ObjectRef> left_out;  ///< what a DCF cannot carry
};

/// Reads every setting that `eds` describes, one after the other. A value that is `$NODEID` and what the description
/// adds to it stays that, so that the DCF is for any node-ID. What the device's own RPDOs write (their mappings are
/// among what was read) is no setting. `eds` must stay. Errors: Errc::not_found nothing of it could be read; those of
/// SDO but aborts; those of `make_dcf_text`.
[[nodiscard]] rt::Task<Result<UploadedConfiguration>> upload_configuration(co::SdoAccess& device, const eds::File& eds,
                                                                           NodeId node);

}  // namespace berth::manager
