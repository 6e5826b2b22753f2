#include "berth/co/sdo_client.hpp"

#include <algorithm>
#include <utility>

#include "berth/co/retry_parts.hpp"
#include "berth/co/sdo_client_parts.hpp"

namespace berth::co {

using sdo::Scs;

namespace {

constexpr const char* never_left = "the SDO request never left: no device acknowledges it, or the bus is full";

std::uint64_t bit_of(ObjectRef ref) noexcept {
  return std::uint64_t{1} << ((ref.index ^ ref.index >> 6U ^ ref.sub * 7U) % 64U);
}

// CiA 301 §7.2.4.3.17 has these codes for downloads only.
bool refuses_download(const can::Frame& frame) noexcept {
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) != Scs::abort) return false;
  const auto code = sdo::abort_code(frame);
  return code == AbortCode::read_only || code == AbortCode::invalid_value || code == AbortCode::value_too_high ||
         code == AbortCode::value_too_low;
}

const char* why_not(can::Queued queued) noexcept {
  switch (queued) {
    case can::Queued::bus_off: return "the SDO request never left: bus-off";
    case can::Queued::listen_only: return "the SDO request never left: the port is listen-only";
    case can::Queued::closed: return "the SDO request never left: the port is closed";
    default: return never_left;
  }
}

bool wants_block(const SdoOptions& options, const SdoClientData& data) noexcept {
  if (options.mode == SdoMode::segmented) return false;
  if (options.mode == SdoMode::block || !data.is_download()) return true;
  const auto size = data.size();
  return !size || *size >= options.block_from;
}

// For all transfers but block transfers.
inline void put_initiate(can::Frame& request, ObjectRef ref, SdoClientData& data) noexcept {
  if (!data.is_download()) return sdo::put(request, 0x40, ref);
  const auto size = data.size();
  if (data.streamed() || *size < 1 || *size > 4) {
    return sdo::put(request, size ? 0x21 : 0x20, ref, static_cast<std::uint32_t>(size.value_or(0)));
  }
  sdo::put(request, static_cast<std::uint8_t>(0x23U | ((4U - *size) << 2U)), ref);
  const auto bytes = *data.window(*size);
  for (std::size_t i = 0; i < *size; ++i) request.data[4 + i] = bytes[i];
}

}  // namespace

// ---- one transfer

SdoTransfer::SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSource& source)
    : SdoTransfer(line, node, ref, options) {
  extra_.reset(new Extra(*this, line.dispatcher()));
  extra_->stream.source = &source;
  data_.use(extra_->stream);
}

SdoTransfer::SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSink& sink)
    : SdoTransfer(line, node, ref, options) {
  extra_.reset(new Extra(*this, line.dispatcher()));
  extra_->stream.sink = &sink;
  data_.use(extra_->stream);
}

SdoTransfer::~SdoTransfer() {
  if (state_ == State::idle || state_ == State::done) return;
  if (state_ != State::queued && state_ != State::initiate) send_abort(AbortCode::general);
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

void SdoTransfer::attempt() noexcept {
  ++attempts_;
  state_ = State::initiate;
  quick_ = not_quick;
  began_ = line_->executor().now();
  data_.begin();
  if (extra_) {
    extra_->block.stop();
    if (!data_.rewind())
      return fail_with(Errc::timeout, 0, "no answer to the SDO request; the source cannot begin anew");
  }
  block_ = !no_block_ && wants_block(options_, data_);
  sdo::address(request_.frame, line_->request_);
  if (block_) {
    if (!extra_) extra_.reset(new Extra(*this, line_->dispatcher()));
    extra_->block.prepare_initiate();
  } else {
    put_initiate(request_.frame, ref_, data_);
    if (!data_.is_download() && !data_.streamed()) {
      quick_ = load_le<std::uint32_t>(request_.frame.data.data()) | 0x03U;
    }
  }
  send();
}

// Up to `answers` frames may answer the request.
void SdoTransfer::send(unsigned answers) noexcept {
  request_.answers = static_cast<std::uint8_t>(answers);
  request_.give_up = line_->executor().now() + options_.send_timeout;
  send_request();
}

void SdoTransfer::send_request() noexcept {
  request_.on_wire = false;
  const auto queued = line_->dispatcher().send(request_.frame, *this);
  switch (queued) {
    case can::Queued::yes: wait_until(request_.give_up); break;
    case can::Queued::full: wait_until(std::min(line_->executor().now() + full_retry, request_.give_up)); break;
    default: fail_with(Errc::bus, 0, why_not(queued));
  }
}

void SdoTransfer::send_abort(AbortCode code) noexcept {
  static_cast<void>(line_->dispatcher().send(sdo::make_abort(line_->request_, ref_, code)));
}

namespace {

rt::Duration least(const SdoOptions& options, NodeId node) noexcept {
  return options.least == nullptr ? rt::Duration{0} : (*options.least)[node.value() & 0x7FU];
}

}  // namespace

void SdoTransfer::sent(rt::Time at) noexcept {
  const bool in_blocks = state_ == State::block;
  if (in_blocks && extra_->block.closing()) return complete();
  request_.on_wire = true;
  auto& line = *line_;
  if (line.open_ + line.owed_ > 0) [[unlikely]]
    line.give_up_open(at);
  line.open_ = request_.answers;
  line.open_ref_ = ref_;
  line.open_until_ = at + line.settings_->late_window;
  auto patience = std::max(options_.timeout, least(options_, node_));
  if (in_blocks && extra_->block.collecting()) {
    extra_->block.request_sent(at);
    patience /= sdo::block_gap_part;
  }
  // Otherwise each attempt could be lost after a frame of the same period, such as the master's own heartbeat, in a
  // server with a receive buffer of one frame.
  if (attempts_ > 1) [[unlikely]]
    patience += patience * (attempts_ - 1) / 16;
  wait_until(at + patience);
}

void SdoTransfer::run() noexcept {
  if (state_ == State::queued) return attempt();
  auto& executor = line_->executor();
  if (request_.deadline == rt::never) return;
  if (executor.now() < request_.deadline) return line_->wake_at(request_.deadline);
  if (request_.on_wire) {
    return state_ == State::block && extra_->block.collecting() ? extra_->block.silence() : timed_out();
  }
  if (!pending() && executor.now() < request_.give_up) return send_request();
  if (pending()) line_->dispatcher().withdraw(*this);
  fail_with(Errc::bus, 0, never_left);
}

void SdoTransfer::timed_out() noexcept {
  const bool again = attempts_ <= options_.retries;
  // While a server collects a sub-block, it takes every frame but an abort for a segment.
  if (block_ || (options_.abort_on_timeout && !again)) send_abort(AbortCode::timeout);
  if (again) return attempt();
  fail_with(Errc::timeout, 0, "no answer to the SDO request");
}

bool SdoTransfer::lingers() noexcept {
  const rt::Duration lasted = line_->executor().now() - began_;
  if (lasted <= most_lingering || data_.streamed()) return false;
  const auto patience = std::max<rt::Duration>(8 * std::max(options_.timeout, least(options_, node_)), most_lingering);
  const std::size_t unacknowledged = state_ == State::block ? extra_->block.collected() : 0U;
  const rt::Duration allowed = std::chrono::milliseconds((data_.done() + unacknowledged) * 1000 / slowest_pace);
  if (lasted <= patience + allowed) return false;
  send_abort(AbortCode::timeout);
  fail_with(Errc::timeout, 0, "the transfer takes too long for what it carries");
  return true;
}

inline bool SdoTransfer::answer(const can::Frame& frame) noexcept {
  const bool aborts = static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::abort;
  if (extra_) {
    if (extra_->waiter.waits()) return aborts && take_abort(frame);
    if (state_ == State::block) return extra_->block.answer(frame);
  }
  if (!request_.on_wire) return false;
  if (state_ == State::segments && segments_.quick_answered(frame, data_)) [[likely]] {
    next_segment();
    return true;
  }
  if (aborts) return take_abort(frame);
  if (state_ == State::initiate) return initiate_answer(frame);
  if (state_ != State::segments) return false;
  // A second answer to the initiate (two nodes with one node-ID, or a late answer) does not belong to this transfer.
  const auto command = static_cast<Scs>(sdo::specifier(frame.data[0]));
  if (command == Scs::upload || command == Scs::download) return false;
  follow(segments_.answered(frame, data_));
  return true;
}

// The most frequent answer: expedited, with its length, to an upload into a value.
inline bool SdoTransfer::awaits(const can::Frame& frame) const noexcept {
  return request_.on_wire && (load_le<std::uint32_t>(frame.data.data()) & 0xFFFF'FFE3U) == quick_;
}

inline void SdoTransfer::take_expedited(const can::Frame& frame) noexcept {
  data_.value().set_expedited(frame.data.data() + 4, 4U - ((frame.data[0] >> 2U) & 0x03U));
  complete();
}

bool SdoTransfer::take_abort(const can::Frame& frame) noexcept {
  const auto object = sdo::multiplexer(frame);
  // A server that lost the transfer (it restarted) no longer knows the object.
  if (object != ref_ && (state_ == State::initiate || object != ObjectRef{})) return false;
  const auto code = sdo::abort_code(frame);
  if (block_ && state_ == State::initiate && code == AbortCode::command_specifier && options_.fall_back) {
    no_block_ = true;
    --attempts_;
    attempt();
    return true;
  }
  // The server's time-out came before ours: this is no refusal.
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
  const bool download = data_.is_download();
  if (sdo::multiplexer(frame) != ref_) return false;
  quick_ = not_quick;
  if (block_ && command == (download ? Scs::block_download : Scs::block_upload)) {
    // Bits 1..0 (download) and 0 (upload) distinguish an initiate from an acknowledgement or an end.
    if ((frame.data[0] & (download ? 0x03U : 0x01U)) != 0) return false;
    extra_->block.initiated(frame);
    return true;
  }
  if (download ? block_ || command != Scs::download : command != Scs::upload) return false;
  block_ = false;  // the server switched the protocol
  const auto requested = request_.frame.data[0];
  if (!download) {
    take_initiate(frame);
  } else if (sdo::specifier(requested) == 1 && (requested & 0x02U) != 0) {
    complete();
  } else {
    state_ = State::segments;
    segments_.begin();
    next_segment();
  }
  return true;
}

void SdoTransfer::take_initiate(const can::Frame& frame) noexcept {
  const auto byte = frame.data[0];
  const bool expedited = (byte & 0x02U) != 0;
  const bool sized = (byte & 0x01U) != 0;
  if (expedited) {
    const std::size_t count = sized ? 4U - ((byte >> 2U) & 0x03U) : 4U;
    const auto code = data_.expedited(frame.data.data() + 4, count, sized);
    if (code != AbortCode::none && code != AbortCode::pending) return refuse(code, data_.refusal());
    return complete();
  }
  const auto code = data_.open(sized, sized ? load_le<std::uint32_t>(frame.data.data() + 4) : 0);
  if (code != AbortCode::none) return refuse(code, data_.refusal());
  state_ = State::segments;
  segments_.begin();
  next_segment();
}

void SdoTransfer::next_segment() noexcept {
  // The first check of `lingers`, done here without a call.
  if (line_->executor().now() > began_ + most_lingering && lingers()) return;
  if (segments_.quick_request(request_.frame, data_)) [[likely]]
    return send();
  const auto step = segments_.request(request_.frame, data_);
  if (step.what == SdoSegments::Step::What::request) return send();
  follow(step);
}

void SdoTransfer::follow(const SdoSegments::Step& step) noexcept {
  using What = SdoSegments::Step::What;
  switch (step.what) {
    case What::request: return next_segment();
    case What::wait: return extra_->waiter.wait(Waiter::What::segment);
    case What::done: return complete();
    case What::refuse: return refuse(step.code, step.text);
  }
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
  request_.on_wire = false;
  if (pending()) [[unlikely]]
    line_->dispatcher().withdraw(*this);
  if (extra_) [[unlikely]] {
    extra_->block.stop();
    extra_->waiter.end();
  }
  line_->remove(*this);
}

// ---- a channel

void SdoLine::cancel(const char* why) noexcept {
  while (first_ != nullptr) first_->fail_with(Errc::cancelled, 0, why);
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

// From now on, missing answers to the newest request count as late. Each silence has its own time: later requests that
// are answered do not prolong it.
void SdoLine::give_up_open(rt::Time at) noexcept {
  if (at > owed_until_) {
    owed_ = 0;
    silent_ = 0;
  }
  if (open_ > 0 && at <= open_until_) {
    owe(open_);
    silent_ |= bit_of(open_ref_);
  }
  open_ = 0;
}

// It is not kept in the line: finding the line of each answer would take longer.
rt::Time* SdoLine::owed_since() const noexcept {
  return settings_->learnt == nullptr ? nullptr : &settings_->learnt->owed_since[request_.key() & 0x7FU];
}

void SdoLine::owe(std::uint32_t answers) noexcept {
  if (rt::Time* const since = owed_since(); owed_ == 0 && since != nullptr)
    *since = open_until_ - settings_->late_window;
  owed_ += answers;
  owed_until_ = open_until_;
}

// Answers come in the order of the requests, so the first late one belongs to the first request. To which request a
// later one belongs is not known.
void SdoLine::learn(NodeId node, const can::Frame& frame, rt::Time at) noexcept {
  if (settings_->learnt == nullptr) return;
  const rt::Time since = std::exchange(settings_->learnt->owed_since[node.value() & 0x7FU], rt::Time{});
  const bool upload = static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::upload;
  if (!upload || since == rt::Time{}) return;
  const rt::Duration took = at - since;
  rt::Duration& patience = settings_->learnt->times[node.value() & 0x7FU];
  patience = std::max(patience, std::min<rt::Duration>(took + took / 4, settings_->learnt->most));
}

// A device that boots answers no earlier request.
void SdoLine::booted() noexcept {
  owed_ = 0;
  if (rt::Time* const since = owed_since()) *since = {};
  silent_ = 0;
  const bool on_wire = first_ != nullptr && first_->request_.on_wire;
  if (!on_wire) open_ = 0;
}

// Segments and blocks name no object; some servers' aborts name a wrong one.
bool SdoLine::may_be_owed(const can::Frame& frame) const noexcept {
  const auto scs = static_cast<Scs>(sdo::specifier(frame.data[0]));
  const bool names_object = scs == Scs::upload || scs == Scs::download;
  return !names_object || (silent_ & bit_of(sdo::multiplexer(frame))) != 0;
}

// A node owes one answer to each request, and to a block upload as many as a sub-block has segments.
void OtherClientRequests::asked(const can::Frame& request, rt::Time at, rt::Duration patience) noexcept {
  constexpr std::uint32_t most = 128;
  const auto ccs = static_cast<sdo::Ccs>(sdo::specifier(request.data[0]));
  if (!sdo::well_formed(request) || ccs == sdo::Ccs::abort) return;
  const bool block = ccs == sdo::Ccs::block_upload;
  if (at > until_ || block != block_) *this = {};
  block_ = block;
  answers_ = block ? most : std::min(answers_ + 1, most);
  objects_ |= bit_of(sdo::multiplexer(request));
  until_ = at + patience;
}

bool OtherClientRequests::take(const can::Frame& answer, rt::Time at) noexcept {
  if (answers_ == 0 || at > until_) return false;
  const auto scs = static_cast<Scs>(sdo::specifier(answer.data[0]));
  const bool names_object = !block_ && (scs == Scs::upload || scs == Scs::download);
  if (names_object && (objects_ & bit_of(sdo::multiplexer(answer))) == 0) return false;
  --answers_;
  return true;
}

// If nobody was heard to ask this node, its answer is for a client that was there before this one: for example, a
// master that ended a moment ago.
bool SdoLine::is_for_another(NodeId node, const can::Frame& answer, rt::Time at) noexcept {
  if (settings_->other_clients == nullptr) return false;
  OtherClientRequests& another = settings_->other_clients[node.value() & 0x7FU];
  const bool nobody_asked = open_until_ == rt::Time{} && !another.any();
  return nobody_asked || another.take(answer, at);
}

inline void SdoLine::received(NodeId node, const can::Frame& frame, rt::Time at) noexcept {
  if (!sdo::well_formed(frame)) return;
  SdoTransfer* const first = first_;
  if (first == nullptr || !first->awaits(frame)) [[unlikely]]
    return received_other(node, frame, at);
  open_ = 0;
  first->take_expedited(frame);
}

void SdoLine::received_other(NodeId node, const can::Frame& frame, rt::Time at) noexcept {
  const bool on_wire = first_ != nullptr && first_->request_.on_wire;
  if (!on_wire) give_up_open(at);
  const bool owed = owed_ > 0 && at <= owed_until_ && may_be_owed(frame);
  // If a download was sent twice, a slow device refuses it again while the object is already read.
  const bool belated = owed && first_ != nullptr && !first_->data_.is_download() && refuses_download(frame);
  if (!belated && first_ != nullptr && first_->answer(frame)) {
    if (open_ > 0) --open_;
  } else if (owed) {
    learn(node, frame, at);
    --owed_;
    ++late_;
  } else if (is_for_another(node, frame, at)) {
    return;
  } else if (static_cast<Scs>(sdo::specifier(frame.data[0])) != Scs::abort ||
             sdo::abort_code(frame) != AbortCode::timeout) {  // a server may end a transfer by its own time-out
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

void SdoClient::heed_other_clients() {
  if (settings_.other_clients != nullptr) return;
  settings_.other_clients = other_clients_.data();
  settings_.dispatcher->add(all_sdo_requests, requests_);
}

SdoClient::~SdoClient() {
  for (auto& line : lines_) line.cancel();
}

void SdoClient::received(const can::Frame& frame, rt::Time at) noexcept {
  const NodeId node(static_cast<std::uint8_t>(frame.id & 0x7FU));
  line(node).received(node, frame, at);
}

void SdoClient::Requests::received(const can::Frame& frame, rt::Time at) noexcept {
  client_->other_clients_[frame.id & 0x7FU].asked(frame, at, client_->settings_.late_window);
}

SdoChannelClient::SdoChannelClient(can::Dispatcher& dispatcher, SdoChannel channel, NodeId server,
                                   const SdoOptions& options)
    : SdoTransfers(line_, server, settings_.options),
      settings_{.dispatcher = &dispatcher, .options = options},
      channel_(channel) {
  line_.settings_ = &settings_;
  if (!channel.valid()) return;
  line_.request_ = channel.request;
  dispatcher.add(can::only(channel.response.key()), *this);
}

SdoChannelClient::~SdoChannelClient() { line_.cancel(); }

void SdoChannelClient::received(const can::Frame& frame, rt::Time at) noexcept { line_.received(server(), frame, at); }

}  // namespace berth::co
