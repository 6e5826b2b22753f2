/// The object sections of a device description: [1018], [1018sub1], [2050Name], [2050Value]... Internal to room `eds`.
#pragma once

#include <vector>

#include "berth/eds/keys.hpp"
#include "berth/eds/object_lists.hpp"

namespace berth::eds {

/// "1018", "1018sub1", "2050Name"; empty for every other name.
[[nodiscard]] std::optional<ObjectSection> object_section(std::string_view name) noexcept;

/// Up to four hex digits.
[[nodiscard]] std::optional<std::uint32_t> hex_word(std::string_view text) noexcept;

class ObjectReader {
 public:
  ObjectReader(Context& context, const DeviceInfo& device, const ReadOptions& options);

  /// Reads the object lists and all object sections into `file`.
  void run(File& file, std::uint32_t dummies);

 private:
  void classify();
  [[nodiscard]] ObjectGroup group(std::span<const ObjectSection> sections);
  void read_group(const ObjectGroup& group);
  void read_simple(const ObjectGroup& group, od::ObjectCode code);
  void read_complex(const ObjectGroup& group, od::ObjectCode code);
  void read_compact(const ObjectGroup& group, unsigned count);
  void tell_own_values(const ObjectGroup& group, od::ObjectCode code);
  void check_sub_number(const ObjectGroup& group, bool compact);
  void read_sub(const ObjectGroup& group, const Section& section, const Keys& keys, std::uint8_t sub,
                od::DataType type);
  void name_list(const ObjectGroup& group, unsigned count, std::vector<std::string>& names);
  void value_list(const ObjectGroup& group);
  void denotation_list(const ObjectGroup& group);
  void links(const ObjectGroup& group);
  void add(std::uint16_t index, const od::SubSpec& spec, const Section* section);
  void hand_over(File& file);
  void check_pdo_counts(const od::Description& description);
  void check_mandatory(const od::Description& description);

  Context& context_;
  const DeviceInfo& device_;
  ReadBudget budget_;
  DcfValues values_{};
  KeyReader keys_{context_, values_};
  ObjectLists lists_{context_};
  od::DescriptionBuilder builder_;
  std::vector<ObjectSection> sections_;
  std::size_t own_values_ = 0;           ///< values at objects that cannot have their own
  std::size_t parameters_of_group_ = 0;  ///< their number before the current group
};

}  // namespace berth::eds
