#include "berth/device/own_identifiers.hpp"

#include <array>

#include "berth/co/cob_id.hpp"
#include "berth/od/cia301.hpp"

namespace berth::device {
namespace {

constexpr std::array<std::uint16_t, 2> produced_objects{0x1005, 0x1012};  // SYNC, TIME: bit 30 = 1: this node sends it
constexpr std::uint16_t emcy_object = 0x1014;
using od::cia301::first_server, od::cia301::last_server;

}  // namespace

OwnIdentifiers::OwnIdentifiers(can::Dispatcher& dispatcher, od::Values& values, const co::NmtSlave& nmt, Errors& errors,
                               Owner& owner, bool on)
    : dispatcher_(&dispatcher), values_(&values), nmt_(&nmt), errors_(&errors), owner_(&owner), on_(on) {
  if (!on) return;
  const auto& d = values.description();
  for (const auto index : {produced_objects[0], produced_objects[1], emcy_object}) {
    if (d.find(index) != nullptr) values.attach(*this, index);
  }
  if (d.find(first_server) != nullptr) values.attach(*this, first_server, last_server);
}

template <class Visit>
void OwnIdentifiers::for_each(const Visit& visit) const noexcept {
  const auto id = nmt_->node_id();
  if (!id.configured()) return;
  visit(co::sdo_response_id(id));
  visit(co::error_control_id(id));
  const co::CobId emcy(values_->get_or<std::uint32_t>({emcy_object, 0}, co::emcy_id(id)));
  if (emcy.valid()) visit(emcy.key());
  for (const auto index : produced_objects) {
    const co::CobId produced(values_->get_or<std::uint32_t>({index, 0}, 0));
    if ((produced.raw() & co::CobId::second_bit) != 0) visit(produced.key());
  }
  for (unsigned index = first_server; index <= last_server; ++index) {
    const auto* const object = values_->description().find(static_cast<std::uint16_t>(index));
    if (object == nullptr) break;
    const co::CobId answers(values_->get_or<std::uint32_t>({object->index, 2}, std::uint32_t{co::CobId::invalid_bit}));
    if (answers.valid()) visit(answers.key());
  }
}

void OwnIdentifiers::listen() noexcept {
  stop();
  if (!on_) return;
  for_each([this](std::uint32_t own) { dispatcher_->add(can::only(own), *this); });
}

void OwnIdentifiers::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.remote) return;
  errors_->raise(co::emcy_code::id_collision, co::error_register::communication);
  owner_->doubled();
}

}  // namespace berth::device
