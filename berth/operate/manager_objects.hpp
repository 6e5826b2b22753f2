/// The objects of Berth's own master, so that any SDO client sees a manager of CiA 302: views of the slot table, and
/// requests to the manager by writing (docs/manager-objects.md). Nothing is stored here: each read returns the present
/// state.
///
/// | object | what |
/// | --- | --- |
/// | 1023h | OS command (CiA 301 §7.5.2.27): the remote command buffer and its confirmations |
/// | 1016h | consumer heartbeat times: of each slot's device that is watched by its heartbeat |
/// | 1F20h, 1F21h | the slot's DCF, and its format; written, it is the slot's from then on |
/// | 1F22h | all that the slot's device is configured with, as a concise DCF; likewise |
/// | 1F26h, 1F27h | what its 1020h shall be |
/// | 1F55h, 1F58h | identification and image of the slot's program 1 |
/// | 1F25h | request configuration: "conf" to the node's sub-index, or to 80h for all |
/// | 1F80h to 1F89h | NMT startup, slave assignment, request NMT, request guarding, expected identities, boot time |
/// | 5F00h to 5F09h | statuses of manager, bus and nodes, error statistics, EMCY history |
/// | 5F0Ah | upload configuration: "upld" to the node's sub-index, or to 80h for all that are there |
#pragma once

#include <array>
#include <string>
#include <vector>

#include "berth/od/values.hpp"
#include "berth/operate/agenda.hpp"
#include "berth/operate/dcf_stream.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class ManagerObjects final : private od::Hook, private DcfStream::Owner {
 public:
  /// Requests made by writing. Called within the write: the work follows later, in a job of its own.
  class Requests {
   public:
    virtual void command_nmt(co::NmtCommand command, co::NmtTarget target) = 0;
    /// Unconfigured: all slots.
    virtual void configure(NodeId node) = 0;
    /// Unconfigured: all slots.
    virtual void upload(NodeId node) = 0;
    /// The bytes written to 1F20h or 1F22h for this slot. Returns the answer to the client.
    virtual od::AbortCode store(NodeId node, WrittenFiles::Form form, std::span<const std::uint8_t> bytes) = 0;
    /// False: nothing executes commands here. Else `ManagerObjects::answer` follows, once.
    virtual bool command(std::string text) = 0;

   protected:
    ~Requests() = default;
  };

  /// Adds these objects to a description.
  static void describe(od::DescriptionBuilder& builder);

  /// `values` must have been made with `describe`; all must outlive this.
  ManagerObjects(od::Values& values, BusServices& services, SlotTable& slots, Agenda& agenda, Requests& requests);

  /// The confirmation of the last written command.
  void answer(bool good, std::string reply);

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  std::vector<std::uint8_t> dcf(ObjectRef ref) override;
  od::AbortCode may_store(ObjectRef ref) override;
  od::AbortCode store(ObjectRef ref, std::span<const std::uint8_t> bytes) override;
  [[nodiscard]] std::uint64_t of_node(std::uint16_t index, NodeId node) const;
  [[nodiscard]] std::uint64_t of_manager(std::uint8_t sub) const;
  [[nodiscard]] std::uint64_t of_bus(std::uint8_t sub) const;
  [[nodiscard]] std::uint64_t emergency(std::uint8_t sub) const;
  od::AbortCode ask_nmt(std::uint8_t sub, std::uint8_t state);
  void command_slots(co::NmtCommand command);
  od::AbortCode ask_configuration(std::uint8_t sub, std::uint32_t word);
  od::AbortCode ask_upload(std::uint8_t sub, std::uint32_t word);
  od::AbortCode ask_command(std::span<const std::uint8_t> text);
  [[nodiscard]] bool is_slot(std::uint8_t sub) const;
  [[nodiscard]] bool note(const std::string& what);

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  Requests& requests_;
  std::array<std::uint8_t, 8> number_{};  // of the last read
  std::uint8_t status_ = 0;               // 1023h:02
  std::string reply_;
  std::vector<std::uint8_t> domain_;  // of the last read of 1F58h
  DcfStream dcfs_;
  rt::Time next_command_{};  // a node's commands are paced
};

}  // namespace berth::operate
