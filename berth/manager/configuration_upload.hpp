/// The reverse direction: reads the configuration of a live device into a DCF (CiA 306-1 §5), so that a replacement
/// gets the same. CiA 302-3 stores it in 1F20h of the manager.
#pragma once

#include <string>
#include <vector>

#include "berth/co/sdo_access.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/rt/task.hpp"

namespace berth::manager {

/// Whether it is configuration: it can be read and written, is no register, command, clock or program (`Configuration`
/// omits the same), no DOMAIN, no process output (access rww), and its description allows a scan to read it (ObjFlags
/// bit 1).
[[nodiscard]] bool is_setting(const od::Object& object, const od::SubObject& sub) noexcept;

/// A DCF of the objects in `eds` with these values. Values that a file cannot hold (a text with line breaks) go to
/// `left_out`. Errors: those of `eds::make_dcf`.
[[nodiscard]] Result<std::string> make_dcf_text(const eds::File& eds, eds::Configuration configuration,
                                                std::vector<ObjectRef>& left_out);

/// 1021h, the EDS stored in the device (1022h: its format). Errors: Errc::not_found it has none; Errc::unsupported the
/// format is not plain text as in CiA 301; those of SDO.
[[nodiscard]] rt::Task<Result<std::string>> read_own_eds(co::SdoAccess& device);

struct UploadedConfiguration {
  std::string dcf;
  std::size_t read = 0;             ///< values in it
  std::size_t refused = 0;          ///< described, but missing or not readable now
  std::vector<ObjectRef> left_out;  ///< values that a DCF cannot hold
};

/// Reads every setting in `eds`, one after the other. A value that equals `$NODEID` plus the number in the description
/// is stored in that form, so that the DCF suits any node-ID. Objects that the device's own RPDOs write (according to
/// the mappings just read) are no settings. `eds` must outlive the task. Errors: Errc::not_found nothing could be read;
/// those of SDO except aborts; those of `make_dcf_text`.
[[nodiscard]] rt::Task<Result<UploadedConfiguration>> upload_configuration(co::SdoAccess& device, const eds::File& eds,
                                                                           NodeId node);

}  // namespace berth::manager
