/// The functions that carry out the verbs. The request's verb must match the function; `request` and `reply` must
/// outlive the task.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

using operate::Network;
using operate::SlotReport;
using tree::Session;

rt::Task<void> report(Session& session, const Request& request, Reply& reply);          // slots.cpp
rt::Task<void> slot_status(Session& session, const Request& request, Reply& reply);     // slot_status.cpp
rt::Task<void> bind(Session& session, const Request& request, Reply& reply);            // slots.cpp
rt::Task<void> replace(Session& session, const Request& request, Reply& reply);         // slots.cpp
rt::Task<void> poll(Session& session, const Request& request, Reply& reply);            // slots.cpp
rt::Task<void> forget(Session& session, const Request& request, Reply& reply);          // slots.cpp
rt::Task<void> scan(Session& session, const Request& request, Reply& reply);            // scan.cpp
rt::Task<void> boot(Session& session, const Request& request, Reply& reply);            // boot.cpp
rt::Task<void> configure(Session& session, const Request& request, Reply& reply);       // configure.cpp
rt::Task<void> upload(Session& session, const Request& request, Reply& reply);          // upload.cpp
rt::Task<void> backup_save(Session& session, const Request& request, Reply& reply);     // backup.cpp
rt::Task<void> backup_compare(Session& session, const Request& request, Reply& reply);  // backup.cpp
rt::Task<void> backup_restore(Session& session, const Request& request, Reply& reply);  // backup.cpp
rt::Task<void> locate(Session& session, const Request& request, Reply& reply);          // locate.cpp
rt::Task<void> sdo_read(Session& session, const Request& request, Reply& reply);        // sdo.cpp
rt::Task<void> sdo_write(Session& session, const Request& request, Reply& reply);       // sdo.cpp
rt::Task<void> nmt_command(Session& session, const Request& request, Reply& reply);     // nmt.cpp
rt::Task<void> sdo_probe(Session& session, const Request& request, Reply& reply);       // probe.cpp
rt::Task<void> lss_command(Session& session, const Request& request, Reply& reply);     // lss.cpp
/// The same for a caller that holds the network's turn.
rt::Task<void> lss_service(Session& session, const Request& request, Reply& reply);       // lss.cpp
rt::Task<void> sdo_dump(Session& session, const Request& request, Reply& reply);          // dump.cpp
rt::Task<void> sdo_connect(Session& session, const Request& request, Reply& reply);       // channels.cpp
rt::Task<void> sdo_release(Session& session, const Request& request, Reply& reply);       // channels.cpp
rt::Task<void> sdo_channels(Session& session, const Request& request, Reply& reply);      // channels.cpp
rt::Task<void> emcy(Session& session, const Request& request, Reply& reply);              // emcy.cpp
rt::Task<void> device_memory(Session& session, const Request& request, Reply& reply);     // memory.cpp
rt::Task<void> send(Session& session, const Request& request, Reply& reply);              // send.cpp
rt::Task<void> doctor_command(Session& session, const Request& request, Reply& reply);    // doctor.cpp
rt::Task<void> history(Session& session, const Request& request, Reply& reply);           // history.cpp
rt::Task<void> note_command(Session& session, const Request& request, Reply& reply);      // note.cpp
rt::Task<void> program_status(Session& session, const Request& request, Reply& reply);    // program.cpp
rt::Task<void> program_download(Session& session, const Request& request, Reply& reply);  // program.cpp
rt::Task<void> program_control(Session& session, const Request& request, Reply& reply);   // program.cpp
rt::Task<void> bit_rate_command(Session& session, const Request& request, Reply& reply);  // bit_rate.cpp
rt::Task<void> world_command(Session& session, const Request& request, Reply& reply);     // world.cpp

}  // namespace berth::command
