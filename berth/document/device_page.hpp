/// Pages of device descriptions: one for each that slots of the machine have.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "berth/document/bus_signals.hpp"
#include "berth/document/machine_document.hpp"

namespace berth::document {

class DevicePages {
 public:
  explicit DevicePages(const std::vector<DescribedSlot>& slots);
  /// HTML: the slot's type, as a link where there is a page of it.
  [[nodiscard]] std::string link(const design::Slot& slot) const;
  [[nodiscard]] std::vector<DocumentFile> pages() const;

 private:
  std::vector<const DescribedSlot*> first_;  // whose descriptions differ, one for each; they must stay
};

/// HTML: the objects that the configured device has other than its description's defaults.
[[nodiscard]] std::string differences(const DescribedSlot& slot);

}  // namespace berth::document
