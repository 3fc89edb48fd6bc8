"""The parts of the lab that are not USD: maps, navigation files, evidence, submissions."""
