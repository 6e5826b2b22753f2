/// An SDO client can write a DCF or a concise DCF to 1F20h or 1F22h of the manager. It becomes the configuration of its
/// slot (paper 5 §2; docs/manager-objects.md) and replaces `config =`.
#pragma once

#include <span>
#include <string>

#include "berth/manager/configuration.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/operate/configuring.hpp"
#include "berth/operate/written_files.hpp"

namespace berth::operate {

/// For users: the file with what an SDO client wrote, and the line of the machine file that would name it.
[[nodiscard]] std::string where_it_is(const WrittenFiles& files, const Seat& seat);
/// Reports for which slots a written configuration replaces `config =`.
void tell_written(SlotTable& slots, const WrittenFiles& files);

class ConfigurationIntake {
 public:
  /// Both must outlive this.
  ConfigurationIntake(SlotTable& slots, Configuring& configuring) noexcept : slots_(slots), configuring_(configuring) {}

  /// Empty bytes, or a concise DCF without entries, remove what was written in this form. Returns the answer to the SDO
  /// client. Both refusal and acceptance are events of the slot, with what to do. Refused:
  /// - 0609 0030 not a DCF, or it sets nothing
  /// - 0604 0043 not for the slot's device, or not for its objects
  /// - 0601 0002 an entry for an object that cannot be written
  /// - 0800 0020 it cannot be stored
  /// - 0800 0021 the machine file names what is to be removed
  od::AbortCode take(Seat& seat, WrittenFiles::Form form, std::span<const std::uint8_t> bytes);

 private:
  struct Refusal {
    od::AbortCode code;
    std::string why;
  };
  [[nodiscard]] static Refusal judge(const Seat& seat, const manager::LoadedConfiguration& loaded);
  [[nodiscard]] static Refusal judge_objects(const Seat& seat, std::span<const std::uint8_t> stream);
  [[nodiscard]] std::string counted_by_berth(const Seat& seat, const manager::Configuration& written) const;
  od::AbortCode take_away(Seat& seat, WrittenFiles::Form form);
  od::AbortCode refuse(const Seat& seat, WrittenFiles::Form form, const Refusal& refusal);
  void not_configured_yet(Seat& seat);

  SlotTable& slots_;
  Configuring& configuring_;
};

}  // namespace berth::operate
