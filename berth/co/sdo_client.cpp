#include "berth/co/sdo_client.hpp"

#include <algorithm>

#include "berth/co/retry_parts.hpp"
#include "berth/co/sdo_client_parts.hpp"

namespace berth::co {

using sdo::Scs;

namespace {

constexpr const char* never_left = "the SDO request never left: no device acknowledges it, or the bus is full";

std::uint64_t bit_of(ObjectRef ref) noexcept {
  return std::uint64_t{1} << ((ref.index ^ ref.index >> 6U ^ ref.sub * 7U) % 64U);
}

const char* why_not(can::Queued queued) noexcept {
  switch (queued) {
    case can::Queued::bus_off: return "the SDO request never left: bus-off";
    case can::Queued::listen_only: return "the SDO request never left: the port is listen-only";
    case can::Queued::closed: return "the SDO request never left: the port is closed";
    default: return never_left;
  }
}

}  // namespace

// ---- one transfer

SdoTransfer::SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSource& source)
    : SdoTransfer(line, node, ref, options) {
  download_ = streamed_ = true;
  need_extra();
  extra_->source = &source;
}

SdoTransfer::SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSink& sink)
    : SdoTransfer(line, node, ref, options) {
  streamed_ = true;
  need_extra();
  extra_->sink = &sink;
}

SdoTransfer::~SdoTransfer() {
  if (state_ == State::idle || state_ == State::done) return;
  if (state_ != State::queued && state_ != State::initiate) send_abort(AbortCode::general);
  line_->silent_ |= bit_of(ref_);
  leave();
}

bool SdoTransfer::start() {
  error_.reset();
  attempts_ = 0;
  no_block_ = false;
  if (!node_.configured()) {
    error_ = make_error(Errc::invalid, 0, "an SDO to an unconfigured node-ID");
    return false;
  }
  if (!line_->request_.valid()) {
    error_ = make_error(Errc::invalid, 0, "the SDO channel is not valid: bit 31 of a COB-ID is set");
    return false;
  }
  state_ = State::queued;
  line_->enqueue(*this);
  return true;
}

Error SdoTransfer::make_error(Errc code, std::uint32_t detail, const char* text) const noexcept {
  return {.code = code, .node = node_.value(), .sub = ref_.sub, .index = ref_.index, .detail = detail, .text = text};
}

std::optional<std::size_t> SdoTransfer::size_to_send() const noexcept {
  return streamed_ ? extra_->source->size() : std::optional(data_.size());
}

inline void SdoTransfer::prepare_initiate() noexcept {
  if (block_) return prepare_block_initiate();
  if (!download_) {
    sdo::put(request_, 0x40, ref_);
    if (!streamed_) quick_ = load_le<std::uint32_t>(request_.data.data()) | 0x03U;
    return;
  }
  const auto size = size_to_send();
  if (!streamed_ && *size >= 1 && *size <= 4) {
    sdo::put(request_, static_cast<std::uint8_t>(0x23U | ((4U - *size) << 2U)), ref_);
    for (std::size_t i = 0; i < *size; ++i) request_.data[4 + i] = data_[i];
  } else {
    sdo::put(request_, size ? 0x21 : 0x20, ref_, static_cast<std::uint32_t>(size.value_or(0)));
  }
}

// False: the source cannot give its bytes once more.
bool SdoTransfer::begin_anew() noexcept {
  extra_->stop();
  if (!streamed_ || !download_) return true;
  if (extra_->touched && !extra_->source->rewind()) return false;
  extra_->touched = false;
  extra_->ahead.begin(extra_->stash);
  return true;
}

void SdoTransfer::attempt() noexcept {
  ++attempts_;
  state_ = State::initiate;
  quick_ = not_quick;
  value_.clear();
  began_ = line_->executor().now();
  offset_ = indicated_ = 0;
  toggle_ = last_ = unsized_ = size_indicated_ = false;
  if (extra_ && !begin_anew())
    return fail_with(Errc::timeout, 0, "no answer to the SDO request; the source cannot begin anew");
  block_ = wants_block();
  sdo::address(request_, line_->request_);
  prepare_initiate();
  send_by(began_ + options_.send_timeout, 1);
}

// Sends the request, to which so many answers may come.
void SdoTransfer::send(unsigned answers) noexcept { send_by(line_->executor().now() + options_.send_timeout, answers); }

inline void SdoTransfer::send_by(rt::Time give_up, unsigned answers) noexcept {
  expects_ = static_cast<std::uint8_t>(answers);
  give_up_ = give_up;
  send_request();
}

void SdoTransfer::send_request() noexcept {
  window_ = false;
  auto& executor = line_->executor();
  const auto queued = line_->dispatcher().send(request_, *this);
  switch (queued) {
    case can::Queued::yes: wait_until(give_up_); break;
    case can::Queued::full: wait_until(std::min(executor.now() + full_retry, give_up_)); break;
    default: fail_with(Errc::bus, 0, why_not(queued));
  }
}

void SdoTransfer::send_abort(AbortCode code) noexcept {
  static_cast<void>(line_->dispatcher().send(sdo::make_abort(line_->request_, ref_, code)));
}

void SdoTransfer::sent(rt::Time at) noexcept {
  if (state_ == State::closing) return complete();
  window_ = true;
  auto& line = *line_;
  if (at > line.owed_until_) {
    line.owed_ = 0;
    line.silent_ = 0;
  }
  line.owed_ += expects_;
  line.owed_until_ = at + line.settings_->late_window;
  const bool collecting = state_ == State::block && !download_;
  if (collecting) extra_->heard = at;
  auto patience = collecting ? options_.timeout / sdo::block_gap_part : options_.timeout;
  // Else each attempt would be lost behind a frame of the same period: the master's own heartbeat, say, in a server
  // that has a receive buffer of one frame.
  if (attempts_ > 1) [[unlikely]]
    patience += patience * (attempts_ - 1) / 16;
  wait_until(at + patience);
}

void SdoTransfer::run() noexcept {
  if (state_ == State::queued) return attempt();
  auto& executor = line_->executor();
  if (deadline_ == rt::never) return;
  if (executor.now() < deadline_) return line_->wake_at(deadline_);
  if (window_) return state_ == State::block && !download_ ? block_silence() : timed_out();
  if (!pending() && executor.now() < give_up_) return send_request();
  if (pending()) line_->dispatcher().withdraw(*this);
  fail_with(Errc::bus, 0, never_left);
}

void SdoTransfer::timed_out() noexcept {
  line_->silent_ |= bit_of(ref_);
  const bool again = attempts_ <= options_.retries;
  // A server that collects a sub-block takes everything but an abort for a segment.
  if (block_ || (options_.abort_on_timeout && !again)) send_abort(AbortCode::timeout);
  if (again) return attempt();
  fail_with(Errc::timeout, 0, "no answer to the SDO request");
}

bool SdoTransfer::lingers() noexcept {
  const rt::Duration lasted = line_->executor().now() - began_;
  if (lasted <= most_lingering || streamed_) [[likely]]
    return false;
  const auto patience = std::max<rt::Duration>(8 * options_.timeout, most_lingering);
  const bool collecting = state_ == State::block && !download_;
  const std::size_t unacknowledged = collecting ? extra_->receiver.good() * sdo::segment_bytes : 0U;
  const rt::Duration allowed = std::chrono::milliseconds((offset_ + unacknowledged) * 1000 / slowest_pace);
  if (lasted <= patience + allowed) return false;
  send_abort(AbortCode::timeout);
  fail_with(Errc::timeout, 0, "the transfer takes too long for what it carries");
  return true;
}

bool SdoTransfer::answer(const can::Frame& frame) noexcept {
  if (extra_ && extra_->wait != Extra::Wait::nothing) {
    return static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::abort && take_abort(frame);
  }
  // Sub-blocks: what is received is segments, and what is sent may be acknowledged before all of it is out.
  if (state_ == State::block) {
    if (download_) return block_acknowledged(frame);
    if (window_ && frame.data[0] != 0x80) return block_segment(frame);
  }
  if (!window_) return false;
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::abort) return take_abort(frame);
  switch (state_) {
    case State::initiate: return initiate_answer(frame);
    case State::segments: return segment_answer(frame);
    case State::block_end: return end_block_upload(frame);
    default: return false;
  }
}

// The most frequent of all: an expedited answer that says its length, to an upload into a value.
inline bool SdoTransfer::awaits(const can::Frame& frame) const noexcept {
  return window_ && (load_le<std::uint32_t>(frame.data.data()) & 0xFFFF'FFE3U) == quick_;
}

inline void SdoTransfer::take_expedited(const can::Frame& frame) noexcept {
  value_.set_expedited(frame.data.data() + 4, 4U - ((frame.data[0] >> 2U) & 0x03U));
  complete();
}

bool SdoTransfer::take_abort(const can::Frame& frame) noexcept {
  const auto object = sdo::multiplexer(frame);
  // Servers that lost the transfer (a restart) do not know the object any more.
  if (object != ref_ && (state_ == State::initiate || object != ObjectRef{})) return false;
  const auto code = sdo::abort_code(frame);
  if (block_ && state_ == State::initiate && code == AbortCode::command_specifier && options_.fall_back) {
    no_block_ = true;
    --attempts_;
    attempt();
    return true;
  }
  // The server's patience ended before ours: no refusal.
  if (code == AbortCode::timeout && attempts_ <= options_.retries) {
    attempt();
    return true;
  }
  fail_with(Errc::aborted, static_cast<std::uint32_t>(code),
            code == AbortCode::pending ? "unknown abort code" : od::text(code));
  return true;
}

bool SdoTransfer::initiate_answer(const can::Frame& frame) noexcept {
  const auto command = static_cast<Scs>(sdo::specifier(frame.data[0]));
  if (sdo::multiplexer(frame) != ref_) return false;
  quick_ = not_quick;
  if (block_ && command == (download_ ? Scs::block_download : Scs::block_upload)) {
    // Bits 1..0 (download) and 0 (upload) tell an initiate from an acknowledgement or an end.
    if ((frame.data[0] & (download_ ? 0x03U : 0x01U)) != 0) return false;
    take_block_initiate(frame);
    return true;
  }
  if (download_ ? block_ || command != Scs::download : command != Scs::upload) return false;
  block_ = false;  // the server switched the protocol
  if (!download_) {
    take_initiate(frame);
  } else if (sdo::specifier(request_.data[0]) == 1 && (request_.data[0] & 0x02U) != 0) {
    complete();
  } else {
    state_ = State::segments;
    next_segment();
  }
  return true;
}

// An upload begins: false when the transfer has ended by that.
bool SdoTransfer::begin_value(bool sized, std::size_t size) noexcept {
  size_indicated_ = sized;
  indicated_ = size;
  if (streamed_) {
    const auto code = extra_->sink->begin(sized ? std::optional(size) : std::nullopt);
    if (code == AbortCode::none) return true;
    refuse(code, "the sink refused the upload");
    return false;
  }
  if (size > options_.longest) {
    refuse(AbortCode::out_of_memory, "the object is longer than allowed");
    return false;
  }
  value_.reserve(size);
  return true;
}

void SdoTransfer::take_initiate(const can::Frame& frame) noexcept {
  const auto byte = frame.data[0];
  const bool expedited = (byte & 0x02U) != 0;
  const bool sized = (byte & 0x01U) != 0;
  if (!expedited) {
    if (!begin_value(sized, sized ? load_le<std::uint32_t>(frame.data.data() + 4) : 0)) return;
    state_ = State::segments;
    return next_segment();
  }
  unsized_ = !sized;
  const std::size_t count = sized ? 4U - ((byte >> 2U) & 0x03U) : 4U;
  if (!streamed_) {
    value_.set_expedited(frame.data.data() + 4, count);
    return complete();
  }
  if (!begin_value(sized, count)) return;
  const auto code = extra_->sink->write({frame.data.data() + 4, count});
  if (code != AbortCode::none && code != AbortCode::pending) return refuse(code, "the sink refused the upload");
  complete();
}

od::Answer<std::span<const std::uint8_t>> SdoTransfer::window(std::size_t count) noexcept {
  if (!streamed_) return data_.subspan(offset_);
  auto& extra = *extra_;
  extra.touched = true;
  const auto size = extra.source->size();
  const auto left = size ? *size - offset_ : count + 1;
  const auto bytes = extra.ahead.want(std::min(count + 1, left), extra.source->ready(),
                                      [&extra](std::span<std::uint8_t> into) { return extra.source->read(into); });
  if (!bytes || !size) return bytes;
  if (bytes->size() < std::min(count + 1, left)) return od::refuse(AbortCode::no_data);
  return bytes->first(std::min(bytes->size(), left));
}

void SdoTransfer::consume(std::size_t count) noexcept {
  offset_ += count;
  if (streamed_) extra_->ahead.consume(count);
}

void SdoTransfer::next_segment() noexcept {
  if (lingers()) return;
  const unsigned toggle = toggle_ ? sdo::toggle_bit : 0U;
  if (!download_) {
    sdo::put(request_, static_cast<std::uint8_t>(0x60U | toggle), {});
    return send();
  }
  if (data_.size() - offset_ > sdo::segment_bytes && !streamed_) {
    sdo::put_segment(request_, static_cast<std::uint8_t>(toggle), data_.data() + offset_);
    offset_ += sdo::segment_bytes;
    return send();
  }
  const auto rest = window(sdo::segment_bytes);
  if (!rest && rest.error() == AbortCode::pending) return extra_->wait_for(Extra::Wait::segment);
  if (!rest) return refuse(rest.error(), "the source gave no more bytes");
  last_ = rest->size() <= sdo::segment_bytes;
  const auto count = last_ ? rest->size() : sdo::segment_bytes;
  const auto command = static_cast<std::uint8_t>(toggle | ((sdo::segment_bytes - count) << 1U) | (last_ ? 1U : 0U));
  if (!last_) {
    sdo::put_segment(request_, command, rest->data());
  } else {
    sdo::put(request_, command, {});
    if (count > 0) std::memcpy(request_.data.data() + 1, rest->data(), count);
  }
  consume(count);
  send();
}

bool SdoTransfer::segment_answer(const can::Frame& frame) noexcept {
  const auto command = static_cast<Scs>(sdo::specifier(frame.data[0]));
  // A second answer to the initiate (two nodes, one node-ID; a late one): not ours.
  if (command == Scs::upload || command == Scs::download) return false;
  if (command != (download_ ? Scs::download_segment : Scs::upload_segment)) {
    refuse(AbortCode::command_specifier, "the server answered with an unexpected command");
  } else if (((frame.data[0] & sdo::toggle_bit) != 0) != toggle_) {
    refuse(AbortCode::toggle_bit, "the server did not alternate the toggle bit");
  } else {
    toggle_ = !toggle_;
    take_segment(frame);
  }
  return true;
}

void SdoTransfer::take_segment(const can::Frame& frame) noexcept {
  if (download_) return last_ ? complete() : next_segment();
  const std::size_t count = sdo::segment_bytes - ((frame.data[0] >> 1U) & 0x07U);
  const bool last = (frame.data[0] & 0x01U) != 0;
  const auto total = offset_ + count;
  if (size_indicated_ && total > indicated_) return refuse(AbortCode::length_too_high, "more bytes than indicated");
  if (count == 0 && !last) return refuse(AbortCode::general, "an empty segment that is not the last");
  const auto bytes = std::span(frame.data).subspan(1, count);
  auto code = AbortCode::none;
  if (!streamed_) {
    if (total > options_.longest) return refuse(AbortCode::out_of_memory, "the object is longer than allowed");
    value_.append(bytes);
  } else if (count > 0) {
    code = extra_->sink->write(bytes);
    if (code != AbortCode::none && code != AbortCode::pending) return refuse(code, "the sink refused the upload");
  }
  offset_ = total;
  if (!last) return code == AbortCode::pending ? extra_->wait_for(Extra::Wait::segment) : next_segment();
  if (size_indicated_ && total < indicated_) return refuse(AbortCode::length_too_low, "fewer bytes than indicated");
  complete();
}

void SdoTransfer::refuse(AbortCode code, const char* text) noexcept {
  send_abort(code);
  fail_with(Errc::mismatch, static_cast<std::uint32_t>(code), text);
}

void SdoTransfer::complete() noexcept {
  leave();
  finish();
}

void SdoTransfer::fail_with(Errc code, std::uint32_t detail, const char* text) noexcept {
  error_ = make_error(code, detail, text);
  line_->silent_ |= bit_of(ref_);
  leave();
  finish();
}

void SdoLine::remove_of_several(SdoTransfer& transfer) noexcept {
  if (first_ == &transfer) {
    first_ = transfer.next_;
    return executor().post(*this);
  }
  SdoTransfer** link = &first_;
  while (*link != nullptr && *link != &transfer) link = &(*link)->next_;
  if (*link != nullptr) *link = transfer.next_;
}

inline void SdoLine::remove(SdoTransfer& transfer) noexcept {
  if (first_ != &transfer || transfer.next_ != nullptr) [[unlikely]]
    return remove_of_several(transfer);
  first_ = nullptr;
}

inline void SdoTransfer::leave() noexcept {
  state_ = State::done;
  window_ = false;
  if (pending()) [[unlikely]]
    line_->dispatcher().withdraw(*this);
  if (extra_) [[unlikely]]
    extra_->end();
  line_->remove(*this);
}

// ---- a channel

void SdoLine::cancel() noexcept {
  while (first_ != nullptr) first_->fail_with(Errc::cancelled, 0, "the SDO transfer was cancelled");
}

void SdoLine::enqueue(SdoTransfer& transfer) noexcept {
  transfer.next_ = nullptr;
  SdoTransfer** end = &first_;
  if (*end == nullptr) {
    *end = &transfer;
    return transfer.attempt();
  }
  while (*end != nullptr) end = &(*end)->next_;
  *end = &transfer;
}

// Segments and blocks name no object; some servers' aborts name a wrong one.
bool SdoLine::may_be_owed(const can::Frame& frame) const noexcept {
  const auto scs = static_cast<Scs>(sdo::specifier(frame.data[0]));
  const bool names_object = scs == Scs::upload || scs == Scs::download;
  return !names_object || (silent_ & bit_of(sdo::multiplexer(frame))) != 0;
}

inline void SdoLine::received(NodeId node, const can::Frame& frame, rt::Time at) noexcept {
  if (!sdo::well_formed(frame)) return;
  SdoTransfer* const first = first_;
  if (first == nullptr || !first->awaits(frame)) [[unlikely]]
    return received_other(node, frame, at);
  owed_ = owed_ > 0 && at <= owed_until_ ? owed_ - 1 : 0;
  first->take_expedited(frame);
}

void SdoLine::received_other(NodeId node, const can::Frame& frame, rt::Time at) noexcept {
  if (owed_ > 0 && at > owed_until_) owed_ = 0;
  const unsigned open = first_ != nullptr && first_->window_ ? first_->expects_ : 0;
  const bool owed = owed_ > open && may_be_owed(frame);
  if (first_ != nullptr && first_->answer(frame)) {
    if (owed_ > 0) --owed_;
  } else if (owed) {
    --owed_;
    ++late_;
  } else if (static_cast<Scs>(sdo::specifier(frame.data[0])) != Scs::abort ||
             sdo::abort_code(frame) != AbortCode::timeout) {  // a server may give up by itself
    ++surplus_;
    if (settings_->observer != nullptr) settings_->observer->surplus(node, frame, at);
  }
}

// ---- the clients

SdoClient::SdoClient(can::Dispatcher& dispatcher, const SdoOptions& options)
    : settings_{.dispatcher = &dispatcher, .options = options} {
  for (unsigned id = 0; id < lines_.size(); ++id) {
    lines_[id].settings_ = &settings_;
    lines_[id].request_ = CobId(all_sdo_requests.first - 1 + id);
  }
  dispatcher.add(all_sdo_responses, *this);
}

SdoClient::~SdoClient() {
  for (auto& line : lines_) line.cancel();
}

void SdoClient::received(const can::Frame& frame, rt::Time at) noexcept {
  const NodeId node(static_cast<std::uint8_t>(frame.id & 0x7FU));
  line(node).received(node, frame, at);
}

SdoChannelClient::SdoChannelClient(can::Dispatcher& dispatcher, SdoChannel channel, NodeId server,
                                   const SdoOptions& options)
    : settings_{.dispatcher = &dispatcher, .options = options}, channel_(channel), server_(server) {
  line_.settings_ = &settings_;
  if (!channel.valid()) return;
  line_.request_ = channel.request;
  dispatcher.add(can::only(channel.response.key()), *this);
}

SdoChannelClient::~SdoChannelClient() { line_.cancel(); }

void SdoChannelClient::received(const can::Frame& frame, rt::Time at) noexcept { line_.received(server_, frame, at); }

}  // namespace berth::co
