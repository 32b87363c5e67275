"""The cerebellar model articulation controller: quantiser, displacement, addressing, memory."""
