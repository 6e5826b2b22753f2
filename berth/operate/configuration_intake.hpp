/// An SDO client can write a DCF or a concise DCF to 1F20h or 1F22h of the manager (paper 5 §2;
/// docs/manager-objects.md), and a user can give one by `berth configure --from`. It becomes the configuration of its
/// slot and replaces `config =`.
#pragma once

#include <span>
#include <string>

#include "berth/manager/configuration.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/operate/configuring.hpp"
#include "berth/operate/written_files.hpp"

namespace berth::operate {

/// For users: the file with what was given, and the line of the machine file that would name it.
[[nodiscard]] std::string where_it_is(const WrittenFiles& files, const Seat& seat);
/// Reports for which slots a configuration that was given at run time replaces `config =`.
void tell_written(SlotTable& slots, const WrittenFiles& files);

class ConfigurationIntake {
 public:
  /// Both must outlive this.
  ConfigurationIntake(SlotTable& slots, Configuring& configuring) noexcept : slots_(slots), configuring_(configuring) {}

  struct Answer {
    od::AbortCode code = od::AbortCode::none;  ///< to an SDO client
    std::string words{};                       ///< the slot's event: why it is refused, or from when it applies
  };
  /// Of a user: `file` is where it came from. Of an SDO client: empty. Empty bytes, or a concise DCF without entries,
  /// remove what was given in this form. Both refusal and acceptance are events of the slot, with what to do. Refused:
  /// - 0609 0030 not a DCF, or it sets nothing
  /// - 0604 0043 not for the slot's device, or not for its objects
  /// - 0601 0002 an entry for an object that cannot be written
  /// - 0800 0020 it cannot be stored
  /// - 0800 0021 the machine file names what is to be removed
  Answer take(Seat& seat, WrittenFiles::Form form, std::span<const std::uint8_t> bytes, const std::string& file = {});

 private:
  /// What is given, and by whom.
  struct Given {
    WrittenFiles::Form form;
    std::string file;  ///< empty: an SDO client's
  };
  struct Refusal {
    od::AbortCode code;
    std::string why;
  };
  [[nodiscard]] static Refusal judge(const Seat& seat, const manager::LoadedConfiguration& loaded);
  [[nodiscard]] static Refusal judge_objects(const Seat& seat, std::span<const std::uint8_t> stream);
  [[nodiscard]] std::string counted_by_berth(const Seat& seat, const manager::Configuration& written) const;
  Answer take_away(Seat& seat, const Given& given);
  Answer refuse(const Seat& seat, const Given& given, const Refusal& refusal);
  Answer tell(const Seat& seat, std::string words);
  [[nodiscard]] static std::string name_of(const Given& given);
  void not_configured_yet(Seat& seat);

  SlotTable& slots_;
  Configuring& configuring_;
};

}  // namespace berth::operate
